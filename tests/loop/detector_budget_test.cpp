// A detector in a small budget: never more than it, loops all the same, for ever.
#include <gtest/gtest.h>

#include <set>

#include "base/lanes.h"
#include "loop/detector_run.h"
#include "loopd/capacity.h"
#include "support/feature_walk.h"

namespace loopd {
namespace {

using testing::small_config;
using testing::TestRun;
using testing::text_of;

FeatureWalk::Shape shape() {
  return {.route_landmarks = 2'400, .points = 80, .lines = 16, .step = 10};
}

/// Room for about `images` images of the walk.
Config config_for(std::size_t images) {
  Config config = small_config();
  config.features.points = 80;
  config.features.lines = 16;
  config.verify.min_inliers = 15;
  config.index.probation_images = 10;
  config.loop.waiting_frames = 20;
  config.memory_budget_bytes =
      static_cast<std::int64_t>(least_map_bytes(config) * images / MapCapacity::kLeastImages);
  return config;
}

struct Walked {
  int loops = 0;
  int second_lap = 0;  // frames of it
  Evictions evictions;
};

Walked walk(TestRun& run, std::uint64_t frames) {
  const FeatureWalk route(shape());
  Features features;
  Walked walked;
  for (std::uint64_t i = 0; i < frames; ++i) {
    route.see(i, features);
    const Report& r = run.see(features);
    EXPECT_LE(r.bytes, run.detector.capacity_bytes());
    const bool again = i >= route.frames_per_lap();
    walked.second_lap += again ? 1 : 0;
    walked.loops += r.outcome == Outcome::kLoop ? 1 : 0;
  }
  walked.evictions = run.report().evictions;
  return walked;
}

TEST(DetectorBudget, WithRoomForAllNothingIsEvicted) {
  TestRun run(config_for(700));
  const Walked walked = walk(run, 480);
  EXPECT_EQ(walked.evictions, Evictions{});
  EXPECT_GE(walked.loops, walked.second_lap * 95 / 100);
}

TEST(DetectorBudget, WithRoomForAThirdLoopsAreStillFound) {
  TestRun run(config_for(80));
  const Walked walked = walk(run, 480);
  EXPECT_GT(walked.evictions.for_images + walked.evictions.for_words, 200u);
  EXPECT_EQ(walked.evictions.not_kept, 0u);
  EXPECT_GE(walked.loops, walked.second_lap * 90 / 100);
}

TEST(DetectorBudget, TheMapStaysFullAndNeverOverflowsInManyLaps) {
  TestRun run(config_for(60));
  const FeatureWalk route(shape());
  Features features;
  std::size_t fewest = 1000;
  for (std::uint64_t i = 0; i < 1500; ++i) {
    route.see(i, features);
    const Report& r = run.see(features);
    ASSERT_LE(r.bytes, run.detector.capacity_bytes());
    if (i > 300) fewest = std::min(fewest, r.images);
  }
  EXPECT_GE(fewest, 20u);
  EXPECT_GT(run.report().evictions.for_images + run.report().evictions.for_words, 1000u);
}

TEST(DetectorBudget, AWaitingWindowLargerThanTheMapIsThinned) {
  Config config = config_for(60);
  config.loop.waiting_frames = 500;
  TestRun run(config);
  const Walked walked = walk(run, 800);
  EXPECT_GT(walked.evictions.waiting, 200u);
  EXPECT_EQ(walked.evictions.not_kept, 0u);
  EXPECT_GE(run.report().images, 10u) << "the waiting window must leave room for the map";
}

TEST(DetectorBudget, APoorSceneHasRoomForMoreImages) {
  Config config = config_for(60);
  config.features.points = 800;
  config.memory_budget_bytes = static_cast<std::int64_t>(least_map_bytes(config));
  const std::size_t full = map_capacity(config).full_images;
  TestRun run(config);
  walk(run, 600);
  EXPECT_GT(run.report().images, full);
}

TEST(DetectorBudget, EvictionsAreTheSameWithTwoLanes) {
  auto lanes = TwoLanes::start({.name = "lines"});
  ASSERT_TRUE(lanes);
  TestRun one(config_for(60));
  TestRun two(config_for(60), lanes.value().get());
  const FeatureWalk route(shape());
  Features features;
  for (std::uint64_t i = 0; i < 400; ++i) {
    route.see(i, features);
    ASSERT_EQ(text_of(one.see(features), true), text_of(two.see(features), true)) << i;
    ASSERT_EQ(one.report().evictions, two.report().evictions);
  }
}

TEST(DetectorBudget, AStandingCameraAddsNothing) {
  TestRun run(config_for(60));
  walk(run, 200);
  const std::size_t bytes = run.report().bytes;
  const Evictions before = run.report().evictions;
  const FeatureWalk route(shape());
  Features features;
  route.see(199, features);
  for (int i = 0; i < 200; ++i) {
    const Report& r = run.see(features);
    ASSERT_TRUE(r.still);
    ASSERT_NE(r.outcome, Outcome::kLoop);
  }
  EXPECT_LE(run.report().bytes, bytes + 20 * (1 << 15)) << "only what was waiting may be admitted";
  EXPECT_LE(run.report().evictions.for_images + run.report().evictions.for_words,
            before.for_images + before.for_words + 60);
}

}  // namespace
}  // namespace loopd
