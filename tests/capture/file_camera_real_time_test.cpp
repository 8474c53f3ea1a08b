// The file camera in real time. A loaded machine may make anything late, so these tests ask only
// for what holds then too: nothing comes early, every number is delivered or counted as dropped.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <thread>
#include <vector>

#include "base/clock.h"
#include "capture/file_camera.h"
#include "support/camera_events.h"
#include "support/image_files.h"
#include "support/temp_dir.h"

namespace loopd {
namespace {

using ::testing::ElementsAre;
using testing::next_error;
using testing::next_events;
using testing::next_frame;
using testing::pgm_file;
using testing::smooth_image;
using testing::TempDir;

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kSecond_ns = 1'000 * kMs;

class RealTimeTest : public ::testing::Test {
 protected:
  RealTimeTest() {
    for (int i = 0; i < 5; ++i)
      dir_.write(std::to_string(i) + ".pgm", pgm_file(smooth_image(16, 12)));
  }

  std::unique_ptr<Camera> open(FileCameraOptions options) {
    options.path = dir_.string();
    options.loop = true;
    auto camera = open_file_camera(options, pool_);
    EXPECT_TRUE(camera.ok()) << camera.error().message;
    return camera.ok() ? std::move(camera).value() : nullptr;
  }

  TempDir dir_;
  FramePool pool_{1, 16 * 12};
};

TEST_F(RealTimeTest, FramesKeepAbsoluteDeadlines) {
  constexpr std::int64_t kPeriod_ns = 5 * kMs;
  const std::int64_t before_ns = monotonic_now_ns();
  const auto camera = open({.fps = 200});
  const std::int64_t first_ns = next_frame(*camera).time_ns.value();
  EXPECT_GE(first_ns, before_ns);
  EXPECT_LE(first_ns, monotonic_now_ns());
  std::uint64_t delivered = 1;
  std::int64_t least_late_ns = kSecond_ns;
  for (std::uint64_t last = 0; last < 60; ++delivered) {
    const Frame frame = next_frame(*camera);
    EXPECT_GT(frame.sequence, last);
    last = frame.sequence;
    // The first frame was itself delivered a little after the deadline that the rate starts at.
    const std::int64_t late_ns =
        *frame.time_ns - first_ns - static_cast<std::int64_t>(frame.sequence) * kPeriod_ns;
    EXPECT_GT(late_ns, -kSecond_ns);
    if (frame.sequence > 30) least_late_ns = std::min(least_late_ns, late_ns);
    EXPECT_EQ(delivered + 1 + camera->dropped(), frame.sequence + 1);
  }
  // If waits added up, every frame of the second half would be late by many of their errors.
  EXPECT_LT(least_late_ns, kPeriod_ns);
}

TEST_F(RealTimeTest, NothingComesBeforeItsTurn) {
  const auto camera = open({.fps = 100});
  const std::int64_t start_ns = monotonic_now_ns();
  for (int i = 0; i < 10; ++i) {
    const Frame frame = next_frame(*camera);
    EXPECT_GE(*frame.time_ns - start_ns, static_cast<std::int64_t>(frame.sequence) * 10 * kMs);
  }
}

TEST_F(RealTimeTest, AnInterruptEndsALongWait) {
  const auto camera = open({.fps = 0.001});
  next_frame(*camera);
  const std::int64_t start_ns = monotonic_now_ns();
  std::jthread stopper([&camera] { camera->interrupt(); });
  EXPECT_THAT(next_events(*camera, 2), ElementsAre("interrupted", "interrupted"));
  EXPECT_LT(monotonic_now_ns() - start_ns, 500 * kSecond_ns);
}

TEST_F(RealTimeTest, AnInterruptEndsAStallAndAnUnplugging) {
  for (const char* faults : {"stall@0:1000s", "unplug@0:1000s"}) {
    const auto camera = open({.fps = 0.01, .faults = faults});
    std::jthread stopper([&camera] { camera->interrupt(); });
    CameraEvent event = camera->next();
    while (std::holds_alternative<CameraError>(event)) event = camera->next();
    EXPECT_TRUE(std::holds_alternative<Interrupted>(event));
  }
}

TEST_F(RealTimeTest, FramesWithoutABufferAreDroppedAndCounted) {
  const auto camera = open({.fps = 500});
  Frame held = next_frame(*camera);
  std::jthread consumer([&] {
    while (camera->dropped() < 5) std::this_thread::yield();
    held = Frame();
  });
  const Frame frame = next_frame(*camera);
  consumer.join();
  EXPECT_GE(camera->dropped(), 5u);
  EXPECT_EQ(frame.sequence, camera->dropped() + 1);
}

TEST_F(RealTimeTest, FramesWhoseTurnWentByAreDroppedAndCounted) {
  const auto camera = open({.fps = 500});
  const std::int64_t first_ns = next_frame(*camera).time_ns.value();
  while (monotonic_now_ns() < first_ns + 20 * kMs) std::this_thread::yield();
  const Frame frame = next_frame(*camera);
  EXPECT_GE(frame.sequence, 10u);
  EXPECT_EQ(camera->dropped(), frame.sequence - 1);
}

TEST_F(RealTimeTest, ALateCallStillEndsAtTheLastImage) {
  FileCameraOptions options{.path = dir_.string(), .fps = 1000};
  auto camera = open_file_camera(options, pool_);
  ASSERT_TRUE(camera.ok());
  const std::int64_t first_ns = next_frame(**camera).time_ns.value();
  while (monotonic_now_ns() < first_ns + 20 * kMs) std::this_thread::yield();
  EXPECT_THAT(next_events(**camera, 2), ElementsAre("end", "end"));
  EXPECT_EQ((*camera)->dropped(), 4u);
}

TEST_F(RealTimeTest, AnUnpluggedCameraIsAwayForItsTime) {
  const auto camera = open({.fps = 100, .faults = "unplug@1:600ms"});
  next_frame(*camera);
  const CameraError unplugged = next_error(*camera);
  EXPECT_EQ(unplugged.fault, CameraFault::kUnplugged);
  EXPECT_TRUE(unplugged.lost);
  const std::int64_t since_ns = monotonic_now_ns();
  EXPECT_THAT(next_events(*camera, 1), ElementsAre("no_device 1 lost"));
  EXPECT_GE(monotonic_now_ns() - since_ns, 490 * kMs);  // the call waited, so callers need not
  const Frame frame = next_frame(*camera);
  EXPECT_GE(frame.sequence, 1u);
  EXPECT_GE(*frame.time_ns - since_ns, 590 * kMs);
}

TEST_F(RealTimeTest, AStallBeyondTheTimeOutIsReported) {
  const auto camera = open({.fps = 100, .faults = "stall@1:1100ms"});
  const std::int64_t first_ns = next_frame(*camera).time_ns.value();
  EXPECT_THAT(next_events(*camera, 1), ElementsAre("stalled 1 lost"));
  EXPECT_GE(*next_frame(*camera).time_ns - first_ns, 1100 * kMs);
}

TEST_F(RealTimeTest, JumpsApplyToTheClockToo) {
  const auto camera = open({.fps = 1000, .faults = "jump@0:-1h"});
  const std::int64_t time_ns = next_frame(*camera).time_ns.value();
  EXPECT_LT(time_ns, monotonic_now_ns() - 3599 * kSecond_ns);
}

TEST_F(RealTimeTest, BadFramesKeepTheRateToo) {
  for (int i = 0; i < 5; ++i) dir_.write(std::to_string(i) + ".pgm", "");
  const auto camera = open({.fps = 100});
  const std::int64_t start_ns = monotonic_now_ns();
  std::uint64_t sequence = 0;
  for (int i = 0; i < 8; ++i) sequence = next_error(*camera).sequence;
  EXPECT_GE(sequence, 7u);
  EXPECT_GE(monotonic_now_ns() - start_ns, static_cast<std::int64_t>(sequence) * 10 * kMs);
}

}  // namespace
}  // namespace loopd
