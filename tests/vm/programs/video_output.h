#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/unique_fd.h"

namespace loopd::vm {

/// A V4L2 output device that streams what is put into it: vivid's output or a v4l2loopback device.
/// Move-only; destruction stops the stream. Thread: one caller at a time.
class VideoOutput {
 public:
  /// Opens `device` for progressive images of `fourcc` ("YUYV", "GREY") and starts its stream.
  /// Errors: no such device, or it would not do this format.
  static Result<VideoOutput> open(const std::string& device, const std::string& fourcc,
                                  int width_px, int height_px);
  ~VideoOutput();
  VideoOutput(VideoOutput&&) noexcept = default;
  VideoOutput& operator=(VideoOutput&&) = delete;

  /// Memory of the next image. Waits until the driver is done with a buffer.
  Result<std::span<std::uint8_t>> next_image();

  /// Gives the image last got from next_image() to the driver; `bytes` of it are filled.
  Status show(std::size_t bytes);

 private:
  explicit VideoOutput(UniqueFd fd) : fd_(std::move(fd)) {}
  Status map_buffers();

  UniqueFd fd_;
  std::vector<std::span<std::uint8_t>> buffers_;
  std::size_t unused_ = 0;  ///< buffers the driver has never had: index unused_ .. size - 1
  std::size_t current_ = 0;
};

}  // namespace loopd::vm
