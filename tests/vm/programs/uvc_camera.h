#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "usb_ip.h"
#include "uvc_descriptors.h"

namespace loopd::vm {

/// What the host has asked to be streamed.
struct StreamFormat {
  bool mjpeg = false;
  FrameSize size{};
  std::int64_t interval_ns = 0;
};

/// A faulty frame.
enum class FrameFault : std::uint8_t {
  kNone,
  kErrorBit,   ///< the camera itself says that it is damaged
  kTruncated,  ///< it ends in the middle
};

/// A UVC camera on a USB port: answers the host's requests and cuts frames into payloads.
/// Thread: one caller at a time.
class UvcCamera {
 public:
  /// Precondition: the model has sizes.
  UvcCamera(UvcModel model, UsbIpPort port);

  int fd() const { return port_.fd(); }
  /// Answers one request of the host. False: the host has closed the port.
  Result<bool> serve();

  /// The host waits for frames.
  bool wanted() const { return !transfers_.empty(); }
  const StreamFormat& format() const { return format_; }
  /// The last frame is still on its way.
  bool sending() const { return offset_ < frame_.size(); }
  /// Starts to send a frame. Precondition: !sending() and the bytes fit format().
  Status send(std::span<const std::uint8_t> bytes, FrameFault fault);

 private:
  using Answer = std::optional<std::vector<std::uint8_t>>;  // none: stall

  Status control(const Submit& submit);
  Answer standard_request(const Submit& submit);
  Answer stream_request(const Submit& submit);
  void propose(std::span<const std::uint8_t> wishes);
  void drop_frame();
  Status forget(const Unlink& unlink);
  Status pump();

  const UvcModel model_;
  UsbIpPort port_;
  std::array<std::uint8_t, 26> probe_{};  ///< what host and camera are agreeing on
  StreamFormat format_{};
  std::deque<Submit> transfers_;  ///< of the stream, not yet answered
  std::vector<std::uint8_t> frame_;
  std::size_t offset_ = 0;
  std::uint8_t flags_ = 0;  ///< of the frame's payload headers
  bool toggle_ = false;
  std::vector<std::uint8_t> payload_;
};

}  // namespace loopd::vm
