#include "uvc_camera.h"

#include <algorithm>
#include <cassert>

namespace loopd::vm {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kPayloadBytes = 16384;
constexpr std::size_t kPayloadHeader = 2;
enum PayloadFlag : std::uint8_t {
  kFrameToggle = 0x01,
  kEndOfFrame = 0x02,
  kErrorBit = 0x40,
  kEndOfHeader = 0x80
};

// USB 2.0, chapter 9.
constexpr std::uint8_t kTypeMask = 0x60;
constexpr std::uint8_t kGetStatus = 0;
constexpr std::uint8_t kClearFeature = 1;
constexpr std::uint8_t kGetDescriptor = 6;
// UVC 1.0, 4.2 and 4.3.1.
constexpr std::uint8_t kSetCurrent = 0x01;
constexpr std::uint8_t kGetResolution = 0x84;
constexpr std::uint8_t kGetLength = 0x85;
constexpr std::uint8_t kGetInfo = 0x86;
constexpr std::uint8_t kProbe = 1;
constexpr std::uint8_t kCommit = 2;
// Offsets in the probe and commit block.
constexpr std::size_t kFormatIndex = 2;
constexpr std::size_t kFrameIndex = 3;
constexpr std::size_t kInterval = 4;
constexpr std::size_t kMaxFrameBytes = 18;
constexpr std::size_t kMaxPayload = 22;

void store32(std::uint8_t* to, std::size_t value) {
  for (int i = 0; i < 4; ++i) to[i] = static_cast<std::uint8_t>(value >> (8 * i) & 0xff);
}
std::uint32_t load32(const std::uint8_t* from) {
  return static_cast<std::uint32_t>(from[0] | from[1] << 8 | from[2] << 16) |
         static_cast<std::uint32_t>(from[3]) << 24;
}

}  // namespace

UvcCamera::UvcCamera(UvcModel model, UsbIpPort port)
    : model_(std::move(model)), port_(std::move(port)) {
  assert(!model_.sizes.empty());
  propose({});
}

Result<bool> UvcCamera::serve() {
  auto request = port_.receive();
  if (!request) return request.error();
  if (std::holds_alternative<Detached>(request.value())) return false;
  Status status = Nothing{};
  if (const auto* unlink = std::get_if<Unlink>(&request.value())) {
    status = forget(*unlink);
  } else {
    auto& submit = std::get<Submit>(request.value());
    if (submit.endpoint == 0) {
      status = control(submit);
    } else {
      transfers_.push_back(std::move(submit));
      status = pump();
    }
  }
  if (!status) return status.error();
  return true;
}

Status UvcCamera::control(const Submit& submit) {
  const bool standard = (submit.setup[0] & kTypeMask) == 0;
  const Answer answer = standard ? standard_request(submit) : stream_request(submit);
  return answer ? port_.complete(submit, *answer) : port_.stall(submit);
}

UvcCamera::Answer UvcCamera::standard_request(const Submit& submit) {
  const std::uint8_t request = submit.setup[1];
  if (request == kGetStatus) return Bytes{0, 0};
  if (request == kGetDescriptor) {
    const unsigned type = submit.setup[3];
    if (type == 1) return device_descriptor(model_);
    if (type == 2) return configuration_descriptor(model_);
    if (type != 3) return std::nullopt;
    auto text = string_descriptor(model_, submit.setup[2]);
    return text.empty() ? Answer() : Answer(std::move(text));
  }
  if (request == kClearFeature) drop_frame();  // how the host ends a bulk stream
  return submit.to_host ? Answer() : Bytes();
}

UvcCamera::Answer UvcCamera::stream_request(const Submit& submit) {
  const std::uint8_t request = submit.setup[1];
  const std::uint8_t selector = submit.setup[3];
  if (submit.setup[4] != kStreamingInterface || (selector != kProbe && selector != kCommit)) {
    return std::nullopt;
  }
  if (request == kSetCurrent) {
    propose(submit.data);
    return Bytes();
  }
  if (request == kGetInfo) return Bytes{3};  // may be read and set
  if (request == kGetLength) return Bytes{static_cast<std::uint8_t>(probe_.size()), 0};
  if (request == kGetResolution) return Bytes(probe_.size());
  return Bytes(probe_.begin(), probe_.end());
}

/// Takes the host's wishes as far as the camera can fulfil them.
void UvcCamera::propose(std::span<const std::uint8_t> wishes) {
  std::copy_n(wishes.begin(), std::min(wishes.size(), probe_.size()), probe_.begin());
  auto& format = probe_[kFormatIndex];
  if (format != kFormatYuyv && format != kFormatMjpeg) format = kFormatYuyv;
  auto& frame = probe_[kFrameIndex];
  if (frame < 1 || frame > model_.sizes.size()) frame = 1;
  const std::uint32_t slow = frame_interval(model_.fps / 2);
  const bool half_rate = load32(&probe_[kInterval]) == slow;
  const std::uint32_t interval = half_rate ? slow : frame_interval(model_.fps);
  format_ = {format == kFormatMjpeg, model_.sizes[frame - 1U], std::int64_t{interval} * 100};
  store32(&probe_[kInterval], interval);
  const auto pixels = static_cast<std::size_t>(format_.size.width_px) *
                      static_cast<std::size_t>(format_.size.height_px);
  store32(&probe_[kMaxFrameBytes], 2 * pixels);
  store32(&probe_[kMaxPayload], kPayloadBytes);
}

void UvcCamera::drop_frame() {
  frame_.clear();
  offset_ = 0;
}

Status UvcCamera::forget(const Unlink& unlink) {
  const auto found = std::find_if(transfers_.begin(), transfers_.end(),
                                  [&](const Submit& s) { return s.id == unlink.target; });
  const bool cancelled = found != transfers_.end();
  if (cancelled) transfers_.erase(found);
  if (transfers_.empty()) drop_frame();
  return port_.unlinked(unlink, cancelled);
}

Status UvcCamera::send(std::span<const std::uint8_t> bytes, FrameFault fault) {
  assert(!sending());
  if (fault == FrameFault::kTruncated) bytes = bytes.first(bytes.size() / 3);
  frame_.assign(bytes.begin(), bytes.end());
  offset_ = 0;
  toggle_ = !toggle_;
  flags_ = static_cast<std::uint8_t>(kEndOfHeader | (toggle_ ? kFrameToggle : 0) |
                                     (fault == FrameFault::kErrorBit ? kErrorBit : 0));
  return pump();
}

/// Fills the transfers that wait with what is left of the frame.
Status UvcCamera::pump() {
  while (sending() && !transfers_.empty()) {
    const Submit transfer = std::move(transfers_.front());
    transfers_.pop_front();
    const std::size_t room = std::min(transfer.length, kPayloadBytes) - kPayloadHeader;
    const std::size_t size = std::min(room, frame_.size() - offset_);
    const bool last = offset_ + size == frame_.size();
    payload_.assign({static_cast<std::uint8_t>(kPayloadHeader),
                     static_cast<std::uint8_t>(flags_ | (last ? kEndOfFrame : 0))});
    const auto from = frame_.begin() + static_cast<std::ptrdiff_t>(offset_);
    payload_.insert(payload_.end(), from, from + static_cast<std::ptrdiff_t>(size));
    offset_ += size;
    const Status status = port_.complete(transfer, payload_);
    if (!status) return status;
  }
  return Nothing{};
}

}  // namespace loopd::vm
