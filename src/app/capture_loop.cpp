#include "app/capture_loop.h"

#include <string>
#include <utility>
#include <variant>

#include "base/clock.h"

namespace loopd {
namespace {

/// One bad frame after another fills no log: each kind of fault is logged this often at most.
constexpr std::int64_t kLogInterval_ns = 10'000'000'000;

constexpr std::int64_t kNewNodePatience_ns = 1'000'000'000;

State state_of(const CameraError& error) {
  return error.fault == CameraFault::kStalled ? State::kCameraStalled : State::kCameraLost;
}

std::string remedy_for(CameraFault fault) {
  switch (fault) {
    case CameraFault::kNoDevice:
    case CameraFault::kUnplugged:
      return "plug the camera in; loopd goes on by itself";
    case CameraFault::kPermission:
      return "give the service's user access to the device";
    case CameraFault::kStalled:
      return "check cable and light; loopd goes on by itself";
    default:
      return "";
  }
}

}  // namespace

void CaptureLoop::run(Camera& camera) {
  if (state_) begin_again();
  while (std::visit([this](auto&& event) { return handle(std::move(event)); }, camera.next()))
    counters_.answers.fetch_add(1, std::memory_order_relaxed);
}

/// What was told of the camera before says nothing about this one.
void CaptureLoop::begin_again() {
  fault_.reset();
  denied_since_ns_.reset();
  noticed_ = {};
  told_ns_ = {};
  state_ = State::kCameraLost;
  tell({LogLevel::kNotice,
        {*state_, monotonic_now_ns(), "it is opened again, with other settings", ""},
        Notice::Kind::kState});
}

bool CaptureLoop::handle(Frame frame) {
  counters_.frames.fetch_add(1, std::memory_order_relaxed);
  counters_.away = false;
  if (state_ != State::kRunning && state_ != State::kCameraBack) {
    state_ = state_.has_value() ? State::kCameraBack : State::kRunning;
    tell({LogLevel::kNotice,
          {*state_, monotonic_now_ns(), "frames arrive", ""},
          Notice::Kind::kState});
  }
  tap_.offer(frame);
  return lock_step_ ? mailbox_.put_when_empty(std::move(frame)) : mailbox_.put(std::move(frame));
}

bool CaptureLoop::handle(const CameraError& error) {
  if (error.lost || error.fault == CameraFault::kStalled)
    camera_away(error);
  else
    frame_lost(error);
  return true;
}

bool CaptureLoop::handle(const CameraNotice& notice) {
  // A camera that comes and goes says the same each time.
  const std::int64_t now_ns = monotonic_now_ns();
  Noticed& before = noticed_.at(static_cast<std::size_t>(notice.kind));
  if (before.message == notice.message && now_ns - before.time_ns < kLogInterval_ns) return true;
  before = {notice.message, now_ns};
  const LogLevel level =
      notice.kind == CameraNotice::Kind::kOpened ? LogLevel::kInfo : LogLevel::kWarning;
  tell({level, {State::kRunning, now_ns, notice.message, ""}, Notice::Kind::kCamera});
  return true;
}

bool CaptureLoop::handle(EndOfStream) {
  counters_.away = true;
  counters_.ended = true;  // told by the detect thread once it has worked on the last frame
  mailbox_.close();
  return false;
}

void CaptureLoop::camera_away(const CameraError& error) {
  if (!is_news(error)) return;
  if (!counters_.away.exchange(true)) counters_.losses.fetch_add(1, std::memory_order_relaxed);
  state_ = state_of(error);
  fault_ = error.fault;
  tell({LogLevel::kWarning,
        {*state_, monotonic_now_ns(), error.message, remedy_for(error.fault),
         std::string(camera_fault_name(error.fault))},
        Notice::Kind::kState});
}

/// Not every answer of a camera that is away: only another state or another cause. That a camera
/// just unplugged is not there is no other cause, nor that a node just made is not yet ours: udev
/// gives it to its group a moment later.
bool CaptureLoop::is_news(const CameraError& error) {
  const bool was_gone = fault_ == CameraFault::kUnplugged || fault_ == CameraFault::kNoDevice;
  if (error.fault != CameraFault::kPermission) denied_since_ns_.reset();
  if (state_ != state_of(error)) return true;
  if (was_gone && error.fault == CameraFault::kNoDevice) return false;
  if (was_gone && error.fault == CameraFault::kPermission) {
    const std::int64_t now_ns = monotonic_now_ns();
    if (!denied_since_ns_) denied_since_ns_ = now_ns;
    return now_ns - *denied_since_ns_ >= kNewNodePatience_ns;
  }
  return fault_ != error.fault;
}

void CaptureLoop::frame_lost(const CameraError& error) {
  counters_.corrupt.fetch_add(1, std::memory_order_relaxed);
  std::optional<std::int64_t>& told_ns = told_ns_.at(static_cast<std::size_t>(error.fault));
  const std::int64_t now_ns = monotonic_now_ns();
  if (told_ns && now_ns - *told_ns < kLogInterval_ns) return;
  told_ns = now_ns;
  tell(
      {LogLevel::kWarning, {State::kRunning, now_ns, error.message, ""}, Notice::Kind::kFrameLost});
}

void CaptureLoop::tell(const Notice& notice) {
  notices_.give(notice);
  wakeup_.wake();
}

}  // namespace loopd
