#include "app/pipeline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ostream>

#include "app/app_fixture.h"

namespace loopd {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::LoopSeen;
using testing::TempDir;

constexpr int kPlaces = 16;

struct Seen {
  std::vector<LoopSeen> loops;
  std::vector<State> states;
  std::vector<std::string> lost_frames;  ///< causes told to the log only
  DetectTotals totals;
  std::uint64_t corrupt = 0;
};

/// Runs `config` until it tells `last`.
Seen run_until(const DaemonConfig& config, State last = State::kCameraEnd) {
  Seen seen;
  auto pipeline = Pipeline::open(config);
  EXPECT_TRUE(pipeline.ok());
  EXPECT_TRUE(pipeline.value()->start().ok());
  const auto on_report = [&seen](const Report& report) {
    if (report.outcome == Outcome::kLoop) seen.loops.push_back(testing::loop_of(report));
  };
  const auto on_notice = [&seen](const Notice& notice) {
    if (notice.is_state())
      seen.states.push_back(notice.record.state);
    else
      seen.lost_frames.push_back(notice.record.cause);
  };
  EXPECT_TRUE(testing::take_until(*pipeline.value(), last, on_report, on_notice));
  pipeline.value()->stop();
  EXPECT_EQ(pipeline.value()->failure(), std::nullopt);
  seen.totals = pipeline.value()->totals();
  seen.corrupt = pipeline.value()->capture().corrupt;
  return seen;
}

TEST(Pipeline, LockStepGivesExactlyTheLoopsOfTheDetectorAloneWithOneOrTwoLanes) {
  const TempDir folder;
  testing::write_laps(folder, kPlaces);
  DaemonConfig config = testing::small_config(folder.string());
  config.events.report_queue = 4;
  const std::vector<LoopSeen> expected = testing::loops_of_detector_alone(config);
  ASSERT_GE(expected.size(), 5u) << "the sequence proves nothing without loops";
  for (const int lanes : {1, 2}) {
    config.threads.lanes = lanes;
    const Seen seen = run_until(config);
    EXPECT_EQ(seen.loops, expected) << lanes << " lanes";
    EXPECT_EQ(seen.totals.frames, 2u * kPlaces);
    EXPECT_EQ(seen.totals.loops, expected.size());
    EXPECT_EQ(seen.totals.errors, 0u);
    EXPECT_THAT(seen.states, ElementsAre(State::kRunning, State::kCameraEnd));
  }
}

TEST(Pipeline, CameraLostAndBackIsToldOnceEach) {
  const TempDir folder;
  testing::write_laps(folder, 6);
  DaemonConfig config = testing::small_config(folder.string());
  config.camera.faults = "unplug@4:1s unplug@8:2s";
  const Seen seen = run_until(config);
  EXPECT_THAT(seen.states, ElementsAre(State::kRunning, State::kCameraLost, State::kCameraBack,
                                       State::kCameraLost, State::kCameraBack, State::kCameraEnd));
  EXPECT_EQ(seen.totals.frames, 12u);
}

TEST(Pipeline, CameraLostInRealTimeComesBack) {
  const TempDir folder;
  testing::write_laps(folder, 6);
  DaemonConfig config = testing::small_config(folder.string());
  config.camera.fps = 100;
  config.camera.loop = true;
  config.camera.faults = "unplug@20:300ms";
  const Seen seen = run_until(config, State::kCameraBack);
  EXPECT_THAT(seen.states, ElementsAre(State::kRunning, State::kCameraLost, State::kCameraBack));
}

TEST(Pipeline, BadFramesCostThemselvesAndOneLineOfLog) {
  const TempDir folder;
  testing::write_laps(folder, 4);
  folder.write("0002.pgm", "P5\n240 180\n255\nshort");
  folder.write("0003.pgm", "no image at all");
  folder.write("0005.pgm", "P5\n9999 9999\n255\n");
  const Seen seen = run_until(testing::small_config(folder.string()));
  EXPECT_EQ(seen.totals.frames, 5u);
  EXPECT_EQ(seen.corrupt, 3u);
  EXPECT_GE(seen.lost_frames.size(), 1u);
  EXPECT_LE(seen.lost_frames.size(), 3u);  // at most one for each kind of fault
  EXPECT_THAT(seen.lost_frames[0], HasSubstr("0002.pgm"));
}

TEST(Pipeline, BlackImagesAreNoReasonToFail) {
  const TempDir folder;
  testing::write_laps(folder, 4);
  for (const char* name : {"0000.pgm", "0001.pgm", "0002.pgm"})
    folder.write(name, testing::pgm_file({240, 180, 1, std::vector<std::uint8_t>(240 * 180)}));
  const Seen seen = run_until(testing::small_config(folder.string()));
  EXPECT_EQ(seen.totals.frames, 8u);
  EXPECT_EQ(seen.totals.errors, 0u);
}

TEST(Pipeline, StopsWhereverItIs) {
  const TempDir folder;
  testing::write_laps(folder, 6);
  for (const double fps : {0.0, 200.0}) {
    DaemonConfig config = testing::small_config(folder.string());
    config.camera.fps = fps;
    config.camera.loop = true;
    config.events.report_queue = 4;  // nobody takes: in lock-step the detector comes to wait here
    auto pipeline = Pipeline::open(config);
    ASSERT_TRUE(pipeline.ok());
    ASSERT_TRUE(pipeline.value()->start().ok());
    pollfd readable{pipeline.value()->wake_fd(), POLLIN, 0};
    EXPECT_EQ(poll(&readable, 1, 60'000), 1);
    pipeline.value()->stop();
    pipeline.value()->stop();
  }
}

/// Waits for the pipeline's next report; null if none comes in a minute.
ReportQueue::Lent next_report(Pipeline& pipeline) {
  while (true) {
    if (ReportQueue::Lent taken = pipeline.take_report()) return taken;
    pollfd readable{pipeline.wake_fd(), POLLIN, 0};
    if (poll(&readable, 1, 60'000) != 1) return nullptr;
    pipeline.drain_wakeups();
    while (pipeline.take_notice()) {
    }
  }
}

TEST(Pipeline, AResetStartsANewMapWithNewIds) {
  const TempDir folder;
  testing::write_laps(folder, kPlaces);
  DaemonConfig config = testing::small_config(folder.string());
  config.camera.loop = true;
  auto pipeline = Pipeline::open(config);
  ASSERT_TRUE(pipeline.ok());
  ASSERT_TRUE(pipeline.value()->start().ok());
  const ReportQueue::Lent first = next_report(*pipeline.value());
  ASSERT_NE(first, nullptr);
  EXPECT_EQ(first->origin.map, 0u);
  pipeline.value()->reset_map();
  std::uint32_t map = 0;
  while (map == 0) {
    const ReportQueue::Lent taken = next_report(*pipeline.value());
    ASSERT_NE(taken, nullptr);
    map = taken->origin.map;
    if (map == 0) continue;
    // The first report of the new map: within its first two laps or so, whatever went before.
    EXPECT_EQ(map, 1u);
    EXPECT_LT(taken->report.query, 3u * kPlaces);
    EXPECT_EQ(pipeline.value()->map(), 1u);
  }
  pipeline.value()->stop();
}

TEST(Pipeline, APausedRecordingWaitsAndThenGivesTheSame) {
  const TempDir folder;
  testing::write_laps(folder, kPlaces);
  DaemonConfig config = testing::small_config(folder.string());
  const std::vector<LoopSeen> expected = testing::loops_of_detector_alone(config);
  auto pipeline = Pipeline::open(config);
  ASSERT_TRUE(pipeline.ok());
  pipeline.value()->pause();
  ASSERT_TRUE(pipeline.value()->start().ok());
  pollfd readable{pipeline.value()->wake_fd(), POLLIN, 0};
  ASSERT_EQ(poll(&readable, 1, 60'000), 1);  // the camera runs
  EXPECT_EQ(pipeline.value()->totals().frames, 0u);
  pipeline.value()->resume();
  std::vector<LoopSeen> loops;
  EXPECT_TRUE(testing::take_until(
      *pipeline.value(), State::kCameraEnd,
      [&loops](const Report& report) {
        if (report.outcome == Outcome::kLoop) loops.push_back(testing::loop_of(report));
      },
      [](const Notice&) {}));
  EXPECT_EQ(loops, expected);
}

TEST(Pipeline, AStopEndsAPause) {
  const TempDir folder;
  testing::write_laps(folder, 4);
  auto pipeline = Pipeline::open(testing::small_config(folder.string()));
  ASSERT_TRUE(pipeline.ok());
  pipeline.value()->pause();
  ASSERT_TRUE(pipeline.value()->start().ok());
  pollfd readable{pipeline.value()->wake_fd(), POLLIN, 0};
  EXPECT_EQ(poll(&readable, 1, 60'000), 1);
  pipeline.value()->stop();
  EXPECT_EQ(pipeline.value()->totals().frames, 0u);
}

TEST(Pipeline, StoppingOneThatNeverStartedIsNothing) {
  const TempDir folder;
  testing::write_laps(folder, 2);
  auto pipeline = Pipeline::open(testing::small_config(folder.string()));
  ASSERT_TRUE(pipeline.ok());
  pipeline.value()->stop();
}

TEST(Pipeline, ThreadsThatCannotHaveTheirCpusAreTold) {
  const TempDir folder;
  testing::write_laps(folder, 2);
  DaemonConfig config = testing::small_config(folder.string());
  config.threads.capture_cpus = config.threads.detect_cpus = config.threads.lines_cpus = {1023};
  auto pipeline = Pipeline::open(config);
  ASSERT_TRUE(pipeline.ok());
  ASSERT_TRUE(pipeline.value()->start().ok());
  EXPECT_EQ(pipeline.value()->thread_shortfalls().size(), 3u);
  config.threads.required = true;
  const auto refused = Pipeline::open(config);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr("'lines' on CPUs 1023"));
}

TEST(Pipeline, ACameraThatIsNotThereIsAnError) {
  const auto pipeline = Pipeline::open(testing::small_config("/nonexistent/images"));
  ASSERT_FALSE(pipeline.ok());
  EXPECT_THAT(pipeline.error().message, HasSubstr("/nonexistent/images"));
}

}  // namespace
}  // namespace loopd
