// A failure inside costs one frame: outcome error, the map as it was, later frames as ever.
#include <gtest/gtest.h>

#include <new>
#include <stdexcept>

#include "base/lanes.h"
#include "loop/detector_run.h"

namespace loopd {
namespace {

using testing::Image;
using testing::laps_of;
using testing::small_config;
using testing::TestRun;
using testing::text_of;
using testing::walk;

/// Which half of a stage fails; the other finishes, as LaneExecutor asks.
enum class Failing { kPoints, kLines, kBoth };

/// Runs both halves, but at the chosen run lets a half fail before it has done anything, as one
/// does that gets no memory.
class FailingLanes : public LaneExecutor {
 public:
  void run(const std::function<void()>& points, const std::function<void()>& lines) override {
    if (left_ == 0 || --left_ > 0) {
      points();
      lines();
      return;
    }
    ++failures_;
    if (failing_ == Failing::kLines) points();
    if (failing_ == Failing::kPoints) lines();
    throw std::bad_alloc();
  }

  /// Fails at the n-th run from now, 1 = the next.
  void fail_at(int n, Failing failing) {
    left_ = n;
    failing_ = failing;
  }
  void hold() { left_ = 0; }
  int failures() const { return failures_; }

 private:
  int left_ = 0;
  Failing failing_ = Failing::kBoth;
  int failures_ = 0;
};

constexpr std::size_t kViews = 14;
constexpr std::size_t kFailed = 20;  // a frame of the second lap: it would be a loop

class Failure : public ::testing::Test {
 protected:
  Failure() : run_(small_config(), &lanes_), reference_(small_config()) {}

  // The frames before the failing one, seen by both.
  void SetUp() override {
    for (std::size_t i = 0; i < kFailed; ++i) {
      run_.see(images_[i]);
      reference_.see(images_[i]);
    }
    ASSERT_EQ(run_.report().outcome, Outcome::kLoop);
    images_before_ = run_.report().images;
  }
  // Both see the frames from `first` on and report the same, to the last bit.
  void expect_rest_is_the_same(std::size_t first) {
    for (std::size_t i = first; i < images_.size(); ++i)
      EXPECT_EQ(text_of(run_.see(images_[i]), false), text_of(reference_.see(images_[i]), false))
          << i;
  }
  // A frame that fails while it is described leaves as little as one that shows nothing.
  void fail_while_describing(Failing failing) {
    lanes_.fail_at(1, failing);
    const Report& r = run_.decide(images_[kFailed]);
    ASSERT_EQ(lanes_.failures(), 1);
    EXPECT_EQ(r.outcome, Outcome::kError);
    EXPECT_EQ(r.query, kFailed);
    EXPECT_EQ(r.sequence, kFailed);
    EXPECT_FALSE(r.match.has_value());
    EXPECT_FALSE(r.verification.has_value());
    EXPECT_TRUE(r.pairs.empty());
    run_.absorb();
    EXPECT_EQ(reference_.see(Image(320, 240, 0)).outcome, Outcome::kNoFeatures);
    EXPECT_EQ(r.images, reference_.report().images);
    expect_rest_is_the_same(kFailed + 1);
  }
  // The update fails: `image` was decided, and the image that should have left the window then
  // leaves it with the next frame. Nothing of it is lost or there twice.
  void fail_while_absorbing(const Image& image, Outcome decided, Outcome absorbed,
                            Failing failing) {
    ASSERT_EQ(run_.decide(image).outcome, decided);
    reference_.see(image);
    lanes_.fail_at(1, failing);
    const Report& r = run_.absorb();
    ASSERT_EQ(lanes_.failures(), 1);
    EXPECT_EQ(r.outcome, absorbed);
    EXPECT_EQ(r.match.has_value(), reference_.report().match.has_value());
    EXPECT_EQ(r.images, images_before_);
    EXPECT_EQ(run_.see(images_[kFailed + 1]).outcome, Outcome::kLoop);
    EXPECT_EQ(r.images, reference_.see(images_[kFailed + 1]).images);
    EXPECT_EQ(r.words_points, reference_.report().words_points);
    EXPECT_EQ(r.words_lines, reference_.report().words_lines);
    expect_rest_is_the_same(kFailed + 2);
  }

  const std::vector<Image> images_ = laps_of(walk(static_cast<int>(kViews)), 2);
  FailingLanes lanes_;
  TestRun run_;
  TestRun reference_;
  std::size_t images_before_ = 0;
};

TEST_F(Failure, OfPointsWhileDescribingLeavesNoTrace) { fail_while_describing(Failing::kPoints); }
TEST_F(Failure, OfLinesWhileDescribingLeavesNoTrace) { fail_while_describing(Failing::kLines); }
TEST_F(Failure, OfBothWhileDescribingLeavesNoTrace) { fail_while_describing(Failing::kBoth); }

TEST_F(Failure, OfBothWhileAbsorbingIsMadeUpForLater) {
  fail_while_absorbing(images_[kFailed], Outcome::kLoop, Outcome::kLoop, Failing::kBoth);
}
TEST_F(Failure, OfPointsWhileAbsorbingIsMadeUpForLater) {
  fail_while_absorbing(images_[kFailed], Outcome::kLoop, Outcome::kLoop, Failing::kPoints);
}
TEST_F(Failure, OfLinesWhileAbsorbingIsMadeUpForLater) {
  fail_while_absorbing(images_[kFailed], Outcome::kLoop, Outcome::kLoop, Failing::kLines);
}

// A frame without a loop is the one to say that its update failed.
TEST_F(Failure, WhileAbsorbingAFrameWithoutALoopIsAnError) {
  const Image black(320, 240, 0);
  run_.decide(images_[kFailed]);  // never absorbed
  reference_.decide(images_[kFailed]);
  fail_while_absorbing(black, Outcome::kNoFeatures, Outcome::kError, Failing::kBoth);
}

// Whatever stage of process() fails, the frame is an error and the map is as it was.
class FailingStage : public ::testing::TestWithParam<Failing> {};

TEST_P(FailingStage, LeavesTheMapAsItWas) {
  const auto images = laps_of(walk(static_cast<int>(kViews)), 2);
  int stages = 0;
  for (int stage = 1; stages < stage; ++stage) {  // ends with the first that is not there
    FailingLanes lanes;
    TestRun run(small_config(), &lanes);
    for (std::size_t i = 0; i < kFailed; ++i) run.see(images[i]);
    lanes.fail_at(stage, GetParam());
    const Outcome outcome = run.decide(images[kFailed]).outcome;
    if (lanes.failures() == 0) break;
    stages = stage;
    lanes.hold();
    EXPECT_EQ(outcome, Outcome::kError) << "stage " << stage;
    EXPECT_FALSE(run.report().match.has_value());
    EXPECT_FALSE(run.report().verification.has_value());
    run.absorb();
    for (std::size_t i = kFailed + 1; i < images.size(); ++i)
      EXPECT_EQ(run.see(images[i]).outcome, Outcome::kLoop) << "stage " << stage << ", frame " << i;
    EXPECT_NE(run.detector.features(kFailed - 1), nullptr);
    EXPECT_EQ(run.detector.features(kFailed), nullptr) << "stage " << stage << ": it was kept";
  }
  EXPECT_GE(stages, 2);  // features and search
}

INSTANTIATE_TEST_SUITE_P(Lane, FailingStage,
                         ::testing::Values(Failing::kPoints, Failing::kLines, Failing::kBoth),
                         [](const auto& param) {
                           return param.param == Failing::kPoints  ? "Points"
                                  : param.param == Failing::kLines ? "Lines"
                                                                   : "Both";
                         });

TEST(DetectorFailure, EveryFrameMayFail) {
  FailingLanes lanes;
  TestRun run(small_config(), &lanes);
  const auto images = laps_of(walk(10), 2);
  for (const Image& image : images) {
    lanes.fail_at(1, Failing::kBoth);
    EXPECT_EQ(run.see(image).outcome, Outcome::kError);
    EXPECT_EQ(run.report().images, 0u);
  }
  EXPECT_EQ(lanes.failures(), 20);
  lanes.hold();
  for (std::size_t i = 0; i < images.size(); ++i)
    EXPECT_EQ(run.see(images[i]).outcome == Outcome::kLoop, i >= 10) << i;
}

TEST(DetectorFailure, ProcessingTwiceForgetsTheFirst) {
  TestRun run(small_config());
  const auto images = laps_of(walk(10), 2);
  std::vector<ImageId> forgotten;
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (i % 3 == 0) forgotten.push_back(run.decide(testing::wall_image(800)).query);
    EXPECT_EQ(run.see(images[i]).outcome == Outcome::kLoop, i >= 10) << i;
  }
  EXPECT_GE(run.report().images, images.size() - 5);
  for (const ImageId image : forgotten) EXPECT_EQ(run.detector.features(image), nullptr) << image;
}

TEST(DetectorFailure, AbsorbingTwiceOrFirstIsHarmless) {
  TestRun once(small_config());
  TestRun twice(small_config());
  twice.absorb();
  EXPECT_EQ(twice.report().images, 0u);
  for (const Image& image : laps_of(walk(10), 2)) {
    once.see(image);
    twice.see(image);
    const std::string before = text_of(twice.report());
    twice.absorb();
    EXPECT_EQ(text_of(twice.report()), before);
    EXPECT_EQ(text_of(once.report()), before);
  }
}

}  // namespace
}  // namespace loopd
