#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "capture/camera.h"
#include "capture/interrupt.h"

namespace loopd {

/// How the pixels of a raw frame lie in memory. Names and layouts are those of V4L2's
/// documentation; of planar formats only the luma plane counts here.
enum class PixelFormat : std::uint8_t {
  kGrey,   ///< 8-bit luma
  kY10,    ///< 10-bit luma in 16-bit little-endian words
  kY16,    ///< 16-bit luma, little-endian
  kNv12,   ///< luma plane first
  kYu12,   ///< luma plane first
  kYuyv,   ///< Y U Y V
  kUyvy,   ///< U Y V Y
  kRgb24,  ///< R G B in memory order
  kBgr24,  ///< B G R in memory order
  kMjpeg,  ///< one JPEG image a frame
};

/// "GREY", "Y10 ", "Y16 ", "NV12", "YU12", "YUYV", "UYVY", "RGB3", "BGR3", "MJPG": V4L2's codes.
std::string_view pixel_format_name(PixelFormat format);
/// The padding of "Y10 " may be left out. None for any other name.
std::optional<PixelFormat> pixel_format_from_name(std::string_view name);

/// Rank of the work that makes luma of it, 0 the least: a copy of rows (and how much the bus
/// carries beside them), every second byte, every second of wider words, three products a pixel, a
/// decoder.
int luma_cost(PixelFormat format);

/// The value of least, least + step, ... most that is nearest to `wish`: how drivers offer sizes.
/// Precondition: least <= most, step >= 1.
int nearest_in_steps(int wish, int least, int most, int step);

/// One frame as the driver gave it. The memory is the driver's until CaptureDevice::release().
struct RawFrame {
  PixelFormat format = PixelFormat::kGrey;
  int width_px = 0;
  int height_px = 0;
  int stride_bytes = 0;  ///< of the luma plane, or of the packed rows; 0 for MJPG
  /// What the driver says it filled, bounded by the buffer it lies in. May be too short.
  std::span<const std::uint8_t> bytes{};
  bool damaged = false;  ///< flagged by the driver as faulty
  std::uint64_t sequence = 0;
  /// Capture time, CLOCK_MONOTONIC nanoseconds, as the driver says; none if its clock is unknown.
  std::optional<std::int64_t> time_ns{};
  /// Older complete frames that were given back unread for this one.
  std::uint64_t passed_over = 0;
};

/// Which instant of a frame its time stamp is.
enum class StampInstant : std::uint8_t { kUnknown, kStartOfExposure, kEndOfFrame };

/// What was opened.
struct DeviceInfo {
  /// The same for the same camera on the same machine, whatever node it gets, and different for
  /// another one as far as it can be known (maker, product, serial number; else the place it is
  /// plugged into).
  std::string id;
  std::string name;  ///< for people: the product's name
  std::string node;  ///< "/dev/video0", or libcamera's camera id
  PixelFormat format = PixelFormat::kGrey;
  int width_px = 0;
  int height_px = 0;
  double fps = 0;  ///< as negotiated; 0 = not known
  /// Of the driver's stamps: "monotonic", "boottime", "copied" (made by whatever feeds a loopback
  /// device, of no certain clock), "unknown".
  std::string clock;
  StampInstant instant = StampInstant::kUnknown;
  /// What was asked for and could not be had, such as a control the camera refuses: one sentence
  /// each. None of it costs the camera.
  std::vector<std::string> warnings{};
};

/// grab() found no frame before its deadline.
struct TimedOut {};

/// An open camera that streams. Destruction stops it and closes it, also when it has gone away.
/// Thread: one caller at a time, the same for its whole life.
class CaptureDevice {
 public:
  using Grab = std::variant<RawFrame, CameraError, TimedOut, Interrupted>;

  virtual ~CaptureDevice() = default;

  /// Waits for the newest complete frame until CLOCK_MONOTONIC reaches `deadline_ns`. A frame must
  /// be given back by release() before the next call. A CameraError with `lost` means that this
  /// object is of no more use; without it, that one frame is.
  virtual Grab grab(const Interrupt& interrupt, std::int64_t deadline_ns) = 0;

  /// Gives the frame of the last grab() back to the driver. No-op if none is out.
  virtual void release() = 0;

  /// What was opened; clock and instant may become known with the first frame only.
  virtual const DeviceInfo& info() const = 0;
};

/// How to get at one camera, again and again.
/// Thread: one caller at a time, the same for its whole life.
class CaptureDriver {
 public:
  using Opened = std::variant<std::unique_ptr<CaptureDevice>, CameraError>;

  virtual ~CaptureDriver() = default;

  /// Opens the camera and starts its stream; bounded in time as far as the kernel is. Errors name
  /// the cause (no device, busy, permission, no signal, unsupported) and the likely remedy.
  virtual Opened open() = 0;

  /// A descriptor that becomes readable when trying open() again may pay (something appeared in
  /// /dev); -1 if there is none. acknowledge() empties it.
  virtual int hotplug_fd() const { return -1; }
  virtual void acknowledge() {}

  /// Which camera is wanted, for logs: "V4L2 camera /dev/video0".
  virtual std::string describe() const = 0;
};

}  // namespace loopd
