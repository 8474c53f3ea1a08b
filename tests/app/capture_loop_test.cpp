#include "app/capture_loop.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <utility>

namespace loopd {
namespace {

using ::testing::ElementsAre;

/// Gives what it was told to, then ends.
class ScriptedCamera : public Camera {
 public:
  explicit ScriptedCamera(std::vector<CameraFault> losses) {
    for (const CameraFault fault : losses) errors_.push_back({fault, "gone", 0, true, 0});
  }
  CameraEvent next() override {
    if (errors_.empty()) return Interrupted{};
    CameraError error = errors_.front();
    errors_.pop_front();
    return error;
  }
  void interrupt() override {}
  std::string describe() const override { return "scripted"; }

 private:
  std::deque<CameraError> errors_;
};

struct Told {
  std::vector<std::string> faults;
  std::uint64_t losses = 0;
};

/// What the loop tells of a camera that answers with `losses`.
Told told_of(std::vector<CameraFault> losses) {
  ScriptedCamera camera(std::move(losses));
  Mailbox<Frame> mailbox;
  RecordingTap tap;
  NoticeQueue notices;
  const auto wakeup = Wakeup::make();
  CaptureCounters counters;
  CaptureLoop(mailbox, tap, notices, wakeup.value(), counters, false).run(camera);
  Told told;
  told.losses = counters.losses;
  while (const auto notice = notices.take()) told.faults.push_back(notice->record.fault);
  return told;
}

TEST(CaptureLoop, ALossIsToldOnceAndAgainForAnotherCause) {
  using enum CameraFault;
  const Told told = told_of({kUnplugged, kNoDevice, kNoDevice, kBusy, kBusy, kStalled, kNoDevice});
  EXPECT_THAT(told.faults, ElementsAre("unplugged", "busy", "stalled", "no_device"));
  EXPECT_EQ(told.losses, 1u);
}

TEST(CaptureLoop, ANodeThatIsNotYetOursIsNoNews) {
  using enum CameraFault;
  EXPECT_THAT(told_of({kNoDevice, kPermission, kPermission}).faults, ElementsAre("no_device"));
  EXPECT_THAT(told_of({kPermission, kPermission}).faults, ElementsAre("permission"));
  EXPECT_THAT(told_of({kBusy, kPermission}).faults, ElementsAre("busy", "permission"));
}

}  // namespace
}  // namespace loopd
