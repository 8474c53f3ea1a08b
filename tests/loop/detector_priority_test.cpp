// The island of the previous image has priority only if its loop passed the geometric check.
#include <gtest/gtest.h>

#include <algorithm>

#include "loop/detector_run.h"
#include "support/descriptor_samples.h"

namespace loopd {
namespace {

using testing::small_config;
using testing::TestRun;

constexpr int kWidth = 640;
constexpr int kHeight = 480;

/// Points all over an image, each with a descriptor that nothing else has.
Features place(std::uint64_t seed, int points = 80) {
  DescriptorSamples samples(seed);
  Features features;
  features.width_px = kWidth;
  features.height_px = kHeight;
  for (int i = 0; i < points; ++i) {
    features.points.push_back({static_cast<float>(40 + samples.below(kWidth - 80)),
                               static_cast<float>(40 + samples.below(kHeight - 80)), 31, 0});
    features.point_descriptors.push_back(samples.independent());
  }
  return features;
}

Features moved(Features features, float by_px) {
  for (Point& p : features.points) p.x_px += by_px;
  return features;
}

/// The same descriptors at places that no camera could see them at.
Features scrambled(Features features) {
  const Features other = place(999, static_cast<int>(features.points.size()));
  features.points = other.points;
  return features;
}

/// The first `of_a` points of `a` and the last `of_b` of `b`.
Features blend(const Features& a, std::ptrdiff_t of_a, const Features& b, std::ptrdiff_t of_b) {
  Features both = a;
  both.points.resize(static_cast<std::size_t>(of_a));
  both.point_descriptors.resize(static_cast<std::size_t>(of_a));
  both.points.insert(both.points.end(), b.points.end() - of_b, b.points.end());
  both.point_descriptors.insert(both.point_descriptors.end(), b.point_descriptors.end() - of_b,
                                b.point_descriptors.end());
  return both;
}

class Priority : public ::testing::Test {
 protected:
  static constexpr ImageId kA = 0;
  static constexpr ImageId kB = 6;

  Priority() : run_(config()) {
    for (std::uint64_t i = 0; i < 12; ++i) run_.see(place(i));  // places kA and kB among them
  }
  // A view of both places, of the second more.
  const Report& see_both() {
    return run_.see(blend(moved(place(kA), 25), 30, moved(place(kB), -25), 50));
  }
  static Config config() {
    Config config = small_config();
    config.loop.waiting_frames = 3;
    config.loop.min_similarity = 0;
    config.loop.island_gap = 1;
    config.loop.verified_islands = 1;
    config.loop.verified_images = 1;
    return config;
  }
  TestRun run_;
};

TEST_F(Priority, WithoutAPreviousLoopTheBetterIslandIsChosen) {
  const Report& r = see_both();
  EXPECT_EQ(r.outcome, Outcome::kLoop);
  ASSERT_TRUE(r.match.has_value());
  EXPECT_EQ(r.match->image, kB);
}

TEST_F(Priority, AfterAVerifiedLoopItsIslandIsChosen) {
  const Report& first = run_.see(moved(place(kA), 5));
  ASSERT_EQ(first.outcome, Outcome::kLoop);
  ASSERT_EQ(first.match->image, kA);
  const Report& second = see_both();
  EXPECT_EQ(second.outcome, Outcome::kLoop);
  ASSERT_TRUE(second.match.has_value());
  EXPECT_EQ(second.match->image, kA);
  EXPECT_EQ(second.fused[0].image, kB);  // by order of islands alone: scores are what they are
}

TEST_F(Priority, AfterACandidateThatFailedTheCheckThereIsNone) {
  const Report& first = run_.see(scrambled(place(kA)));
  ASSERT_NE(first.outcome, Outcome::kLoop);
  ASSERT_TRUE(first.match.has_value());
  ASSERT_EQ(first.match->image, kA);  // it was the candidate
  const Report& second = see_both();
  ASSERT_TRUE(second.match.has_value());
  EXPECT_EQ(second.match->image, kB);
}

TEST_F(Priority, EndsWithTheFirstFrameThatIsNoLoop) {
  ASSERT_EQ(run_.see(moved(place(kA), 5)).outcome, Outcome::kLoop);
  ASSERT_NE(run_.see(place(500)).outcome, Outcome::kLoop);
  const Report& r = see_both();
  ASSERT_TRUE(r.match.has_value());
  EXPECT_EQ(r.match->image, kB);
}

}  // namespace
}  // namespace loopd
