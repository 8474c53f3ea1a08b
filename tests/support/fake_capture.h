#pragma once

#include <unistd.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "capture/live_camera.h"

namespace loopd::testing {

/// A clock that a wait simply moves on. A wait on a descriptor ends at once if `changes` says that
/// something changed by then.
class FakeLiveClock : public LiveClock {
 public:
  std::int64_t now_ns() const override { return now_ns_; }

  Interrupt::Ready wait(const Interrupt& interrupt, int fd, std::int64_t deadline_ns) override {
    if (interrupt.requested()) return Interrupt::Ready::kInterrupted;
    if (fd >= 0 && !changes_ns_.empty() && changes_ns_.front() <= deadline_ns) {
      now_ns_ = std::max(now_ns_, changes_ns_.front());
      changes_ns_.pop_front();
      return Interrupt::Ready::kReadable;
    }
    now_ns_ = std::max(now_ns_, deadline_ns);
    return Interrupt::Ready::kTimeout;
  }

  void pass_ns(std::int64_t duration_ns) { now_ns_ += duration_ns; }
  /// The hotplug descriptor becomes readable at `time_ns`.
  void change_at(std::int64_t time_ns) { changes_ns_.push_back(time_ns); }

 private:
  std::int64_t now_ns_ = 1'000'000'000'000;
  std::deque<std::int64_t> changes_ns_;
};

/// What a fake camera does, shared by its driver and its devices.
struct FakeCamera {
  FakeLiveClock clock;
  DeviceInfo info{.id = "usb-1",
                  .name = "Fake",
                  .node = "/dev/video0",
                  .width_px = 4,
                  .height_px = 2,
                  .fps = 30,
                  .clock = "monotonic"};
  /// The answers of open(), in order; with none left it succeeds. The time it takes is counted.
  std::deque<CameraError> open_errors;
  bool away = false;  ///< open() fails with kNoDevice for as long
  bool hotplug = false;
  /// The answer of grab(), given its deadline.
  std::function<CaptureDevice::Grab(std::int64_t deadline_ns)> grab;

  int opened = 0;
  int open_now = 0;
  int open_calls = 0;
  int out = 0;  ///< raw frames not given back
  std::vector<std::int64_t> open_times_ns;
};

class FakeDevice : public CaptureDevice {
 public:
  explicit FakeDevice(FakeCamera& camera) : camera_(camera), info_(camera.info) {
    ++camera_.opened;
    ++camera_.open_now;
  }
  ~FakeDevice() override { --camera_.open_now; }

  Grab grab(const Interrupt& interrupt, std::int64_t deadline_ns) override {
    if (interrupt.requested()) return Interrupted{};
    Grab answer = camera_.grab(deadline_ns);
    if (std::holds_alternative<RawFrame>(answer)) ++camera_.out;
    if (std::holds_alternative<TimedOut>(answer))
      camera_.clock.pass_ns(std::max<std::int64_t>(deadline_ns - camera_.clock.now_ns(), 0));
    return answer;
  }
  void release() override { camera_.out = 0; }
  const DeviceInfo& info() const override { return info_; }

 private:
  FakeCamera& camera_;
  const DeviceInfo info_;
};

class FakeDriver : public CaptureDriver {
 public:
  explicit FakeDriver(FakeCamera& camera) : camera_(camera) {}

  Opened open() override {
    ++camera_.open_calls;
    camera_.open_times_ns.push_back(camera_.clock.now_ns());
    if (camera_.away)
      return CameraError{CameraFault::kNoDevice, "the fake camera is away", 0, true, 0};
    if (camera_.open_errors.empty()) return std::make_unique<FakeDevice>(camera_);
    CameraError error = camera_.open_errors.front();
    camera_.open_errors.pop_front();
    return error;
  }
  int hotplug_fd() const override { return camera_.hotplug ? STDIN_FILENO : -1; }
  std::string describe() const override { return "fake camera"; }

 private:
  FakeCamera& camera_;
};

}  // namespace loopd::testing
