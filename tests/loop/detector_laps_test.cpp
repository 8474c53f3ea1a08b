// The main job: a second lap of a walk is recognised, and nothing else is.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <utility>

#include "loop/detector_run.h"

namespace loopd {
namespace {

using testing::Image;
using testing::laps_of;
using testing::small_config;
using testing::TestRun;
using testing::View;
using testing::walk;

constexpr int kViews = 30;

/// What must hold for every report, whatever was seen.
void expect_consistent(const Report& r, const Config& config) {
  EXPECT_EQ(r.match.has_value(), r.verification.has_value());
  EXPECT_EQ(r.match.has_value(), r.island.has_value());
  for (const auto* list : {&r.point_candidates, &r.line_candidates, &r.fused})
    for (const Candidate& c : *list) {
      EXPECT_GE(c.score, 0.0);
      EXPECT_LE(c.score, 1.0);
      EXPECT_LE(c.image + static_cast<ImageId>(config.loop.waiting_frames), r.query);
    }
  if (!r.match) return;
  EXPECT_GE(r.match->image, r.island->first);
  EXPECT_LE(r.match->image, r.island->last);
  EXPECT_GE(r.island->best, r.island->first);
  EXPECT_LE(r.island->best, r.island->last);
  EXPECT_GE(r.match->similarity, 0.0);
  EXPECT_LE(r.match->similarity, 1.0);
}

void expect_verified(const Report& r, const Config& config) {
  ASSERT_TRUE(r.verification.has_value());
  EXPECT_GE(r.verification->inliers(), config.verify.min_inliers);
  EXPECT_GE(r.verification->matches(), r.verification->inliers());
  EXPECT_GT(r.verification->cells, 0);
  const auto lines = static_cast<int>(std::count_if(
      r.pairs.begin(), r.pairs.end(), [](const InlierPair& pair) { return pair.is_line; }));
  const int points = static_cast<int>(r.pairs.size()) - lines;
  EXPECT_GE(points, r.verification->point_inliers);  // several may be the same evidence
  EXPECT_GE(lines, r.verification->line_inliers);    // one or two for every line
  EXPECT_LE(lines, 2 * r.verification->line_inliers);
}

/// Walks two laps and expects every view of the second to find its wall in the first.
void expect_second_lap_recognised(const Config& config) {
  const std::vector<View> lap = walk(kViews);
  const std::vector<Image> images = laps_of(lap, 2);
  TestRun run(config);
  for (std::size_t i = 0; i < images.size(); ++i) {
    SCOPED_TRACE("frame " + std::to_string(i));
    const Report& r = run.see(images[i]);
    EXPECT_EQ(r.query, i);
    EXPECT_EQ(r.sequence, i);
    expect_consistent(r, config);
    EXPECT_EQ(r.outcome == Outcome::kLoop, i >= kViews) << outcome_name(r.outcome);
    if (r.outcome != Outcome::kLoop || i < kViews) continue;
    expect_verified(r, config);
    EXPECT_EQ(r.match->sequence, r.match->image);
    ASSERT_LT(r.match->image, static_cast<ImageId>(kViews));
    EXPECT_EQ(lap[r.match->image].wall, lap[i - kViews].wall);
  }
  EXPECT_EQ(run.report().images,
            images.size() - static_cast<std::size_t>(config.loop.waiting_frames) + 1);
}

TEST(DetectorLaps, SecondLapIsRecognised) { expect_second_lap_recognised(small_config()); }

TEST(DetectorLaps, PointsAloneDo) {
  Config config = small_config();
  config.features.lines = 0;
  expect_second_lap_recognised(config);
}

TEST(DetectorLaps, LinesAloneDo) {
  Config config = small_config();
  config.features.points = 0;
  expect_second_lap_recognised(config);
}

TEST(DetectorLaps, ImageZeroIsAMatchLikeAnyOther) {
  const std::vector<View> lap = walk(kViews);  // wall 0 has a single view
  TestRun run(small_config());
  for (const Image& image : laps_of(lap, 1)) run.see(image);
  const Report& r = run.see(testing::wall_image(lap[0].wall, 4, 240, 180));
  EXPECT_EQ(r.outcome, Outcome::kLoop);
  ASSERT_TRUE(r.match.has_value());
  EXPECT_EQ(r.match->image, 0u);
  EXPECT_EQ(r.island->first, 0u);
}

TEST(DetectorLaps, NothingIsAcceptedBelowTheInlierThreshold) {
  Config config = small_config();
  config.verify.min_inliers = 10'000;
  TestRun run(config);
  int verified = 0;
  for (const Image& image : laps_of(walk(kViews), 2)) {
    const Report& r = run.see(image);
    expect_consistent(r, config);
    EXPECT_NE(r.outcome, Outcome::kLoop);
    verified += r.match ? 1 : 0;  // rejected, but the evidence is there
  }
  EXPECT_GE(verified, kViews);
}

/// Deals the positions out anew: the same words in a geometry that cannot be.
template <class T>
void shuffle(std::vector<T>& positions, std::mt19937& random) {
  for (std::size_t i = positions.size(); i > 1; --i)
    std::swap(positions[i - 1], positions[random() % i]);
}

TEST(DetectorLaps, ALoopAfterManyIsVerifiedAsWell) {
  const auto images = laps_of(walk(kViews), 2);
  Config config = small_config();
  config.verify.min_inliers = 40;
  TestRun run(config);
  for (std::size_t i = 0; i < kViews; ++i) run.see(images[i]);
  for (std::size_t i = kViews; i < images.size(); ++i)
    ASSERT_EQ(run.see(images[i]).outcome, Outcome::kLoop) << i;
  Features impossible = *run.detector.features(run.report().query);
  std::mt19937 random(1);
  shuffle(impossible.points, random);
  shuffle(impossible.lines, random);
  const Report& r = run.see(impossible);
  EXPECT_EQ(r.outcome, Outcome::kFewInliers) << outcome_name(r.outcome);
  ASSERT_TRUE(r.verification.has_value());
  EXPECT_GE(r.verification->matches(), config.verify.min_inliers);
}

TEST(DetectorLaps, FeaturesOfMatchedImagesCanBeRead) {
  TestRun run(small_config());
  for (const Image& image : laps_of(walk(kViews), 2)) {
    const Report& r = run.decide(image);
    const Features* query = run.detector.features(r.query);
    ASSERT_NE(query, nullptr);
    EXPECT_EQ(static_cast<int>(query->points.size()), r.points);
    EXPECT_EQ(static_cast<int>(query->lines.size()), r.lines);
    EXPECT_EQ(run.detector.features(r.query + 1), nullptr);
    if (r.match) {
      const Features* match = run.detector.features(r.match->image);
      ASSERT_NE(match, nullptr);
      EXPECT_EQ(match->points.size(), match->point_descriptors.size());
      EXPECT_EQ(match->width_px, image.width_px);
    }
    run.absorb();
  }
}

TEST(DetectorLaps, MapAndBytesGrowWithWhatIsNew) {
  TestRun run(small_config());
  std::size_t bytes = run.detector.bytes();
  for (const Image& image : laps_of(walk(kViews), 1)) {
    const Report& r = run.see(image);
    EXPECT_GT(r.bytes, bytes);
    EXPECT_EQ(r.bytes, run.detector.bytes());
    bytes = r.bytes;
  }
  EXPECT_GT(run.report().words_points, 100u);
  EXPECT_GT(run.report().words_lines, 100u);
}

// The share of the matches that fits decides beside their number: the same laps with nothing less
// than full agreement lose exactly the loops that some match contradicts.
TEST(DetectorLaps, AMatchThatManyOthersContradictIsNoLoop) {
  const std::vector<Image> images = laps_of(walk(12), 2);
  TestRun lenient(small_config());
  Config strict_config = small_config();
  strict_config.verify.min_agreement = 1.0;
  TestRun strict(strict_config);
  int contradicted = 0;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const Report& r = strict.see(images[i]);
    const Outcome before = lenient.see(images[i]).outcome;
    if (before != Outcome::kLoop) continue;
    ASSERT_TRUE(r.verification);
    const bool full = r.verification->agreeing == r.verification->matches();
    EXPECT_EQ(r.outcome, full ? Outcome::kLoop : Outcome::kContradicted) << "frame " << i;
    contradicted += full ? 0 : 1;
  }
  EXPECT_GT(contradicted, 0);
}

}  // namespace
}  // namespace loopd
