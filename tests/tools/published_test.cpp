#include "eval/published.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <ostream>
#include <string>

namespace loopd::eval {
namespace {

namespace fs = std::filesystem;

fs::path shared_folder() {
  const char* named = std::getenv("LOOPD_SHARED");
  return named != nullptr ? fs::path(named) : fs::path(LOOPD_SOURCE_DIR) / ".." / "shared";
}

struct PublishedSet {
  const char* name;
  int waiting;
  int consecutive;
  int tolerance;
  double recall_percent;
  friend std::ostream& operator<<(std::ostream& out, const PublishedSet& set) {
    return out << set.name;  // else test names would hold addresses
  }
};

class PublishedFigures : public ::testing::TestWithParam<PublishedSet> {};

TEST_P(PublishedFigures, AreReproduced) {
  const PublishedSet& set = GetParam();
  const fs::path folder = shared_folder() / "eval" / "published";
  if (!fs::is_directory(folder)) {
    GTEST_SKIP() << "no published detections in " << folder << "; set LOOPD_SHARED";
  }
  const auto detections = read_published(folder / (std::string(set.name) + ".ibow.csv"));
  ASSERT_TRUE(detections.ok()) << detections.error().message;
  const auto truth = GroundTruth::read(folder / (std::string(set.name) + ".groundtruth.csv"));
  ASSERT_TRUE(truth.ok()) << truth.error().message;
  const PublishedRecall best = published_recall(detections.value(), truth.value(), set.waiting,
                                                set.consecutive, set.tolerance);
  EXPECT_EQ(best.precision, 1);
  EXPECT_NEAR(100 * best.recall, set.recall_percent, 0.01);
}

INSTANTIATE_TEST_SUITE_P(Sets, PublishedFigures,
                         ::testing::Values(PublishedSet{"citycentre", 50, 5, 20, 88.24},
                                           PublishedSet{"kitti06", 50, 2, 20, 95.54},
                                           PublishedSet{"lip6indoor", 50, 5, 20, 83.18},
                                           PublishedSet{"lip6outdoor", 50, 5, 1, 85.24},
                                           PublishedSet{"kitti00", 50, 30, 20, 76.36}),
                         [](const auto& set) { return std::string(set.param.name); });

/// Query 3 matches 0, queries 4..6 match 1.
GroundTruth small_truth() {
  GroundTruth truth;
  truth.add(3, 0, Label::kSame);
  for (int query = 4; query <= 6; ++query) truth.add(query, 1, Label::kSame);
  truth.finish();
  return truth;
}

TEST(PublishedRecall, ARunOfDetectionsCarriesAWeakOne) {
  // 3, 4 by inliers; 5 has none but overlaps after a run of two; 6 overlaps nothing.
  const std::vector<PublishedDetection> detections = {{3, 1, 2, 0, false, 60},
                                                      {4, 1, 2, 1, true, 60},
                                                      {5, 1, 2, 1, true, 0},
                                                      {6, 1, 2, 1, false, 0}};
  EXPECT_EQ(published_recall(detections, small_truth(), 1, 1, 0).recall, 0.75);
  EXPECT_EQ(published_recall(detections, small_truth(), 1, 2, 0).recall, 0.5);
}

TEST(PublishedRecall, TheFirstImagesAndEmptyIslandsLeaveTheRunAsItIs) {
  const std::vector<PublishedDetection> detections = {
      {3, 1, 2, 0, false, 60}, {4, 0, 0, 0, false, 0}, {5, 1, 2, 1, true, 0}};
  EXPECT_EQ(published_recall(detections, small_truth(), 1, 0, 0).recall, 2.0 / 3);
  EXPECT_EQ(published_recall(detections, small_truth(), 5, 0, 0).recall, 0)
      << "image 3 is among the first W - 1 = 4, so no run begins";
}

TEST(PublishedRecall, PrecisionComesFirst) {
  // The false detection has 30 inliers: only thresholds from 30 on are free of it.
  const std::vector<PublishedDetection> detections = {
      {3, 1, 2, 0, false, 40}, {4, 1, 2, 1, false, 20}, {5, 8, 9, 8, false, 30}};
  const PublishedRecall best = published_recall(detections, small_truth(), 1, 5, 0);
  EXPECT_EQ(best.precision, 1);
  EXPECT_EQ(best.threshold, 30);
  EXPECT_EQ(best.recall, 1.0 / 3) << "images 4 and 5 are missed";
}

}  // namespace
}  // namespace loopd::eval
