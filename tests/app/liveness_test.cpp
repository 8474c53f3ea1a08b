#include "app/liveness.h"

#include <gtest/gtest.h>

#include "app/detect_loop.h"
#include "app/memory_plan.h"
#include "app/notices.h"

namespace loopd {
namespace {

constexpr std::int64_t kPatience = 100;

TEST(Liveness, DetectionThatAdvancesIsLife) {
  Liveness liveness(kPatience, 0);
  for (std::uint64_t frames = 1; frames < 20; ++frames)
    EXPECT_TRUE(liveness.alive({.frames_detected = frames, .work_pending = true},
                               static_cast<std::int64_t>(frames) * kPatience));
}

TEST(Liveness, AHungDetectorIsNotEvenIfTheCameraIsLost) {
  Liveness liveness(kPatience, 0);
  const Vitals hung{.frames_detected = 5, .work_pending = true, .nothing_to_do = true};
  EXPECT_TRUE(liveness.alive(hung, 10));
  EXPECT_TRUE(liveness.alive(hung, 10 + kPatience));
  EXPECT_FALSE(liveness.alive(hung, 11 + kPatience));
}

TEST(Liveness, ALostCameraIsLifeForAsLongAsItTakes) {
  Liveness liveness(kPatience, 0);
  const Vitals lost{.frames_detected = 5, .nothing_to_do = true};
  for (const std::int64_t now : {1, 1'000, 1'000'000}) EXPECT_TRUE(liveness.alive(lost, now));
}

TEST(Liveness, ACameraThatIsSilentWithoutAReasonIsNot) {
  Liveness liveness(kPatience, 0);
  const Vitals silent{.frames_detected = 5};
  EXPECT_TRUE(liveness.alive(silent, 1));
  EXPECT_FALSE(liveness.alive(silent, 2 + kPatience));
  EXPECT_TRUE(liveness.alive({.frames_detected = 6}, 3 + kPatience));  // and back
}

TEST(Liveness, FailingFrameAfterFrameIsNot) {
  Liveness liveness(kPatience, 0);
  const std::uint64_t most = DetectLoop::kMostErrorsInRow;
  EXPECT_TRUE(liveness.alive({.frames_detected = 1, .errors_in_row = most - 1}, 1));
  EXPECT_FALSE(liveness.alive({.frames_detected = 2, .errors_in_row = most}, 2));
  EXPECT_TRUE(liveness.alive({.frames_detected = 3}, 3));
}

TEST(Liveness, ALostCameraThatSaysNothingForAMinuteIsAHungDriver) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  Liveness liveness(kSecond, 0);
  Vitals vitals{.nothing_to_do = true, .camera_owes_answers = true};
  EXPECT_TRUE(liveness.alive(vitals, 59 * kSecond));
  ++vitals.camera_answers;
  EXPECT_TRUE(liveness.alive(vitals, 60 * kSecond));
  EXPECT_TRUE(liveness.alive(vitals, 119 * kSecond));
  EXPECT_FALSE(liveness.alive(vitals, 121 * kSecond));
  vitals.camera_owes_answers = false;  // a recording at its end
  EXPECT_TRUE(liveness.alive(vitals, 500 * kSecond));
}

TEST(Liveness, PatienceFitsSlowCameras) {
  EXPECT_EQ(patience_for(30, 10'000'000), 5'000'000'000);
  EXPECT_EQ(patience_for(0, 10'000'000), 5'000'000'000);
  EXPECT_EQ(patience_for(0.1, 10'000'000), 50'000'000'000);
}

TEST(MemoryPlan, AddsUpWhatTheConfigAsksFor) {
  DaemonConfig config;
  config.camera.buffers = 3;
  config.camera.max_pixels = 1 << 20;
  config.events.max_clients = 2;
  config.events.client_queue_kib = 512;
  config.detector.features.points = 1000;
  config.detector.features.lines = 0;
  const MemoryPlan plan = memory_plan(config);
  EXPECT_EQ(plan.frame_buffers, 3u << 20);
  EXPECT_EQ(plan.client_queues, 1u << 20);
  EXPECT_EQ(plan.budget, 256u << 20);
  EXPECT_LE(plan.fixed() + plan.map.bytes, plan.budget);
  EXPECT_GT(plan.fixed() + plan.map.bytes, plan.budget - (8u << 20));
  EXPECT_GT(plan.map.full_images, 500u);
  EXPECT_NE(memory_text(plan).find("frame buffers         3.0 MiB"), std::string::npos);
}

TEST(NoticeQueue, TheOldestGivesWaySoThatTheNewestArrives) {
  NoticeQueue queue;
  for (std::int64_t i = 0; i < 100; ++i)
    queue.give({LogLevel::kNotice, {State::kRunning, i, "", ""}});
  std::int64_t first = -1;
  std::int64_t last = -1;
  while (const auto notice = queue.take()) {
    if (first < 0) first = notice->record.time_ns;
    last = notice->record.time_ns;
  }
  EXPECT_EQ(first, 100 - static_cast<std::int64_t>(NoticeQueue::kCapacity));
  EXPECT_EQ(last, 99);
}

}  // namespace
}  // namespace loopd
