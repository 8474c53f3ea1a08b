#include "capture/v4l2_device.h"

#include <linux/videodev2.h>

#include <array>
#include <cerrno>
#include <utility>

#include "capture/v4l2_controls.h"
#include "capture/v4l2_error.h"
#include "capture/v4l2_sysfs.h"

namespace loopd {
namespace {

// More than there can be buffers: a driver that fills them faster than they are taken is not
// followed for ever.
constexpr std::uint64_t kMaxPassedOver = 32;
constexpr int kMaxEvents = 64;
// A descriptor that is ready so often in a row, and then holds nothing, would be waited for by
// spinning.
constexpr int kMaxInVain = 100;

std::optional<std::int64_t> stamp_ns(const V4l2Buffers::Filled& filled) {
  const std::uint32_t clock = filled.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK;
  if (clock != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC && clock != V4L2_BUF_FLAG_TIMESTAMP_COPY)
    return std::nullopt;
  constexpr std::int64_t kMostSeconds = 9'000'000'000;
  const std::int64_t seconds = filled.timestamp.tv_sec;
  const std::int64_t micros = filled.timestamp.tv_usec;
  if (seconds < 0 || seconds > kMostSeconds || micros < 0 || micros > 999'999) return std::nullopt;
  return seconds * 1'000'000'000 + micros * 1'000;
}

}  // namespace

CaptureDriver::Opened V4l2Device::open(const V4l2Options& options, V4l2Io& io,
                                       const V4l2Paths& paths, const std::string& path) {
  int failure = 0;
  V4l2Node node = V4l2Node::open(io, path, failure);
  if (!node.valid()) return v4l2_error(paths, path, "open", failure);
  std::unique_ptr<V4l2Device> device(new V4l2Device(std::move(node), paths, path));
  if (auto error = device->set_up(options)) return *std::move(error);
  return std::unique_ptr<CaptureDevice>(std::move(device));
}

V4l2Device::~V4l2Device() {
  release();
  int type = static_cast<int>(type_);
  if (streaming_) node_.call(VIDIOC_STREAMOFF, type);  // fails if the device has gone: no matter
}

std::optional<CameraError> V4l2Device::set_up(const V4l2Options& options) {
  V4l2Wish wish{options.width_px, options.height_px, options.fps, std::nullopt};
  if (options.format != "auto") {
    wish.format = pixel_format_from_name(options.format);
    if (!wish.format)
      return v4l2_fault(CameraFault::kUnsupported, path_,
                        "cannot be set to the format \"" + options.format +
                            "\": no such name; camera.format is \"auto\" or a code such as YUYV");
  }
  V4l2Capability capability;
  if (auto error = check_capture_node(context(), capability)) return error;
  type_ = capability.type;
  if (auto error = lock_on_signal(context())) return error;
  if (auto error = negotiate(context(), type_, wish, stream_)) return error;
  describe(capability);
  for (std::string& warning : set_controls(node_, options.controls))
    info_.warnings.push_back(std::move(warning));
  return start(options.buffers);
}

void V4l2Device::describe(const V4l2Capability& capability) {
  info_.id =
      stable_id(sysfs_device(paths_, video_name(path_)), capability.bus_info, capability.card);
  info_.name = capability.card;
  info_.node = path_;
  info_.format = stream_.format;
  info_.width_px = stream_.width_px;
  info_.height_px = stream_.height_px;
  info_.fps = stream_.fps;
  info_.warnings = std::move(stream_.warnings);
}

std::optional<CameraError> V4l2Device::start(int buffers) {
  v4l2_event_subscription subscription{};
  subscription.type = V4L2_EVENT_SOURCE_CHANGE;
  node_.call(VIDIOC_SUBSCRIBE_EVENT, subscription);  // not offered by most cameras
  buffers_ = std::make_unique<V4l2Buffers>(node_, type_);
  if (const int result = buffers_->allocate(buffers); result < 0)
    return v4l2_error(paths_, path_, "get buffers of", result);
  note_clock(buffers_->flags());
  int type = static_cast<int>(type_);
  if (const int result = node_.call(VIDIOC_STREAMON, type); result < 0)
    return v4l2_error(paths_, path_, "start the stream of", result);
  streaming_ = true;
  return std::nullopt;
}

void V4l2Device::note_clock(std::uint32_t flags) {
  const std::uint32_t clock = flags & V4L2_BUF_FLAG_TIMESTAMP_MASK;
  const bool start = (flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  info_.clock = clock == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC ? "monotonic"
                : clock == V4L2_BUF_FLAG_TIMESTAMP_COPY    ? "copied"
                                                           : "unknown";
  info_.instant = clock == V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN ? StampInstant::kUnknown
                  : start                                  ? StampInstant::kStartOfExposure
                                                           : StampInstant::kEndOfFrame;
}

CaptureDevice::Grab V4l2Device::grab(const Interrupt& interrupt, std::int64_t deadline_ns) {
  release();
  if (const int result = buffers_->requeue(); result < 0) return failed(result);
  for (int in_vain = 0; in_vain < kMaxInVain;) {
    std::array<pollfd, 2> fds{{{interrupt.fd(), POLLIN, 0}, {node_.fd(), POLLIN | POLLPRI, 0}}};
    const int ready = node_.io().poll(fds, deadline_ns);
    if (interrupt.requested()) return Interrupted{};
    if (ready < 0 && ready != -EINTR) return failed(ready);
    if (ready > 0 && fds[1].revents != 0) {
      if (auto error = handle_events(fds[1].revents)) return *std::move(error);
      Grab grabbed = grab_newest(fds[1].revents);
      if (!std::holds_alternative<TimedOut>(grabbed)) return grabbed;
      ++in_vain;
    }
    if (node_.io().now_ns() >= deadline_ns) return nothing_came();
  }
  return failed(-EIO);
}

CaptureDevice::Grab V4l2Device::nothing_came() const {
  const auto trouble = input_trouble(node_);
  if (!trouble) return TimedOut{};
  return v4l2_fault(
      CameraFault::kNoSignal, path_,
      "(" + info_.name + ") has " + *trouble + "; check the cable and the source's power");
}

// The newest frame there is; TimedOut if there is none after all.
CaptureDevice::Grab V4l2Device::grab_newest(short happened) {
  V4l2Buffers::Filled newest;
  V4l2Buffers::Filled next;
  std::uint64_t passed_over = 0;
  int result = buffers_->take(newest);
  if (result == -EAGAIN && (happened & (POLLERR | POLLHUP | POLLNVAL)) != 0) return failed(-EIO);
  if (result == -EAGAIN) return TimedOut{};
  if (result < 0) return failed(result);
  const auto is_damaged = [](const V4l2Buffers::Filled& filled) {
    return (filled.flags & V4L2_BUF_FLAG_ERROR) != 0;
  };
  for (std::uint64_t taken = 0; taken < kMaxPassedOver && buffers_->take(next) >= 0; ++taken) {
    // A frame of no use takes no good one's place; its number is missing then.
    const bool keep = is_damaged(next) && !is_damaged(newest);
    buffers_->give_back(keep ? next.index : newest.index);  // if that fails, the next grab() does
    if (keep) continue;
    newest = next;
    ++passed_over;
  }
  return raw_frame(newest, passed_over);
}

RawFrame V4l2Device::raw_frame(const V4l2Buffers::Filled& filled, std::uint64_t passed_over) {
  out_ = filled.index;
  buffers_->begin_read(filled.index);
  if (info_.clock.empty() || info_.clock == "unknown") note_clock(filled.flags);
  RawFrame frame;
  frame.format = stream_.format;
  frame.width_px = stream_.width_px;
  frame.height_px = stream_.height_px;
  frame.stride_bytes = stream_.stride_bytes;
  frame.bytes = filled.bytes;
  frame.damaged = (filled.flags & V4L2_BUF_FLAG_ERROR) != 0;
  frame.sequence = filled.sequence;
  frame.time_ns = stamp_ns(filled);
  frame.passed_over = passed_over;
  return frame;
}

void V4l2Device::release() {
  if (!out_) return;
  buffers_->end_read(*out_);
  buffers_->give_back(*out_);  // if that fails, the next grab() tries again
  out_.reset();
}

// Every failure of a running stream ends it: opening anew is cheap, and cures what can be cured.
CaptureDevice::Grab V4l2Device::failed(int result) const {
  if (result == -ENODEV || result == -ENXIO || result == -EBADF) {
    CameraError error =
        v4l2_fault(CameraFault::kUnplugged, path_,
                   "(" + info_.name + ") went away; plug it in, it is opened again by itself");
    error.code = -result;
    return error;
  }
  CameraError error = v4l2_error(paths_, path_, "get a frame of", result);
  error.fault = CameraFault::kStreamError;
  return error;
}

// All events that wait; a change of the source ends the stream.
std::optional<CameraError> V4l2Device::handle_events(short happened) const {
  if ((happened & POLLPRI) == 0) return std::nullopt;
  bool changed = false;
  for (int i = 0; i < kMaxEvents; ++i) {
    v4l2_event event{};
    if (node_.call(VIDIOC_DQEVENT, event) < 0) break;
    changed |= event.type == V4L2_EVENT_SOURCE_CHANGE &&
               (event.u.src_change.changes & V4L2_EVENT_SRC_CH_RESOLUTION) != 0;
  }
  if (!changed) return std::nullopt;
  Grab trouble = nothing_came();
  if (auto* no_signal = std::get_if<CameraError>(&trouble)) return std::move(*no_signal);
  return v4l2_fault(CameraFault::kStreamError, path_,
                    "(" + info_.name +
                        ") has another source or resolution now; it is opened again with that one");
}

}  // namespace loopd
