// A camera that does not move adds nothing to the map and closes no loop with itself.
#include <gtest/gtest.h>

#include <algorithm>

#include "loop/detector_run.h"

namespace loopd {
namespace {

using testing::Image;
using testing::laps_of;
using testing::small_config;
using testing::TestRun;
using testing::walk;
using testing::wall_image;
using testing::with_noise;

constexpr int kWidth = 160;
constexpr int kHeight = 120;
constexpr std::int64_t kSecond = 1'000'000'000;

Config parked_config(int waiting_frames, double waiting_s) {
  Config config = small_config();
  config.features.points = 150;
  config.features.lines = 50;
  config.loop.waiting_frames = waiting_frames;
  config.loop.waiting_s = waiting_s;
  return config;
}

/// The `n`-th look at the same wall by a noisy camera.
Image look(unsigned wall, unsigned n) {
  return with_noise(wall_image(wall, 0, kWidth, kHeight), 3, n + 1);
}

/// What the map holds; nothing of it may grow while the camera is parked.
struct Held {
  std::size_t images = 0;
  std::size_t words_points = 0;
  std::size_t words_lines = 0;
  friend bool operator==(const Held&, const Held&) = default;
};
Held held(const Report& r) { return {r.images, r.words_points, r.words_lines}; }

TEST(DetectorParked, IdenticalFramesAreOneImageAndNoLoop) {
  TestRun run(parked_config(20, 0));
  const Image wall = wall_image(1, 0, kWidth, kHeight);
  std::size_t bytes = 0;
  for (unsigned i = 0; i < 100; ++i) {
    const Report& r = run.see(wall);
    EXPECT_NE(r.outcome, Outcome::kLoop) << i;
    EXPECT_EQ(r.still, i > 0) << i;
    EXPECT_EQ(held(r), Held{}) << i;  // the one image waits
    if (i == 0) bytes = r.bytes;
    EXPECT_EQ(r.bytes, bytes) << i;
  }
}

TEST(DetectorParked, TenMinutesOfNoiseAreOneImageAndNoLoop) {
  TestRun run(parked_config(20, 5));
  std::size_t bytes = 0;
  for (unsigned i = 0; i < 650; ++i) {
    const Report& r = run.see(look(1, i), i * kSecond);
    EXPECT_NE(r.outcome, Outcome::kLoop) << i;
    EXPECT_EQ(r.still, i > 0) << i;
    EXPECT_EQ(held(r), Held{}) << i;
    // The number of features varies with the noise, and so does the newest frame's room; it ends
    // growing soon.
    if (i == 50) bytes = r.bytes;
    if (i > 50) {
      EXPECT_LE(r.bytes, bytes + 64 * 1024) << i;
    }
  }
}

TEST(DetectorParked, AParkedCameraThatDroveBeforeFindsNoneOfItsOwnImages) {
  TestRun run(parked_config(20, 5));
  std::int64_t time_ns = 0;
  for (const Image& image : laps_of(walk(40), 1, kWidth, kHeight)) {
    EXPECT_NE(run.see(image, time_ns).outcome, Outcome::kLoop);
    time_ns += kSecond;
  }
  Held before;
  for (unsigned i = 0; i < 620; ++i, time_ns += kSecond) {
    const Report& r = run.see(look(77, i), time_ns);
    EXPECT_NE(r.outcome, Outcome::kLoop) << i;
    EXPECT_EQ(r.still, i > 0) << i;
    // What waits may still come in for as many frames as the camera moved before, never the place
    // it is parked at.
    EXPECT_LT(r.images, 40u) << i;
    if (i == 60) before = held(r);
    if (i > 60) {
      EXPECT_EQ(held(r), before) << i;
    }
  }
}

TEST(DetectorParked, AParkedCameraStillRecognisesAnOlderVisit) {
  TestRun run(parked_config(20, 0));
  for (const Image& image : laps_of({{77, 0}}, 1, kWidth, kHeight)) run.see(image);
  for (const Image& image : laps_of(walk(25), 1, kWidth, kHeight)) run.see(image);
  int loops = 0;
  for (unsigned i = 0; i < 30; ++i) {
    const Report& r = run.see(look(77, 100 + i));
    if (r.outcome != Outcome::kLoop) continue;
    ++loops;
    EXPECT_EQ(r.match->image, 0u);
  }
  EXPECT_EQ(loops, 30);
}

TEST(DetectorParked, DrivingOnAfterwardsIsSeen) {
  TestRun run(parked_config(5, 0));
  for (unsigned i = 0; i < 100; ++i) run.see(look(77, i));
  for (const Image& image : laps_of(walk(10), 1, kWidth, kHeight)) {
    EXPECT_FALSE(run.see(image).still);
  }
  EXPECT_EQ(run.report().images, 7u);  // 11 kept, the newest wait
  const Report& r = run.see(look(77, 500));
  EXPECT_EQ(r.outcome, Outcome::kLoop);
  EXPECT_EQ(r.match->image, 0u);
}

// Even the shortest window must not hold the place that the camera has not left.
class ShortWindow : public ::testing::TestWithParam<int> {};

TEST_P(ShortWindow, AParkedCameraFindsNoneOfItsOwnImages) {
  TestRun run(parked_config(GetParam(), 0));
  for (const Image& image : laps_of(walk(15), 1, kWidth, kHeight)) run.see(image);
  for (unsigned i = 0; i < 40; ++i) EXPECT_NE(run.see(look(77, i)).outcome, Outcome::kLoop) << i;
}

INSTANTIATE_TEST_SUITE_P(Frames, ShortWindow, ::testing::Values(1, 2, 5, 10));

}  // namespace
}  // namespace loopd
