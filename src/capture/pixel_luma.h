#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>

#include "capture/capture_device.h"

namespace loopd {

/// Turns raw frames of every PixelFormat into 8-bit luma, rows packed.
///  - GREY, NV12, YU12, YUYV, UYVY: the luma as it is stored, byte for byte.
///  - Y10, Y16: the eight most significant of the 10 or 16 bits.
///  - RGB24, BGR24: luma_from_rgb (luma.h).
///  - MJPG: the luma channel, by the JPEG library; damage is an error.
/// Whatever a driver claims of size, stride and length is checked against the bytes that are there.
/// The row loops are the hot path of capture: each fast form is tested against the obvious one.
///
/// Thread: one caller at a time; keeps its JPEG decoder between calls.
class LumaConverter {
 public:
  /// Precondition: max_pixels >= 1.
  explicit LumaConverter(std::size_t max_pixels);
  ~LumaConverter();
  LumaConverter(const LumaConverter&) = delete;
  LumaConverter& operator=(const LumaConverter&) = delete;

  struct Problem {
    CameraFault fault = CameraFault::kCorruptFrame;  ///< or kTooLarge
    std::string message;                             ///< one clause: "holds 100 of 614400 bytes"
  };
  /// Writes width_px * height_px bytes into `luma`; on a problem `luma` holds anything.
  std::optional<Problem> convert(const RawFrame& frame, std::span<std::uint8_t> luma);

 private:
  struct Jpeg;
  const std::size_t max_pixels_;
  std::unique_ptr<Jpeg> jpeg_;
};

}  // namespace loopd
