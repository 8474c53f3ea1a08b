// Frames and features that no one should send.
#include <gtest/gtest.h>

#include <limits>

#include "loop/detector_run.h"

namespace loopd {
namespace {

using testing::Image;
using testing::laps_of;
using testing::small_config;
using testing::TestRun;
using testing::text_of;
using testing::walk;
using testing::wall_image;

constexpr std::size_t kViews = 10;

/// Two laps given to a run that has seen something odd: the second is recognised all the same.
void expect_works(TestRun& run, const char* what) {
  const auto images = laps_of(walk(static_cast<int>(kViews)), 2);
  for (std::size_t i = 0; i < images.size(); ++i)
    EXPECT_EQ(run.see(images[i]).outcome == Outcome::kLoop, i >= kViews)
        << what << ", frame " << i << ": " << outcome_name(run.report().outcome);
}

TEST(DetectorHostile, FirstFramesAreBlack) {
  TestRun run(small_config());
  for (int i = 0; i < 20; ++i) {
    const Report& r = run.see(Image(320, 240, 0));
    EXPECT_EQ(r.outcome, Outcome::kNoFeatures);
    EXPECT_EQ(r.points + r.lines, 0);
    EXPECT_EQ(r.images, 0u);
  }
  expect_works(run, "black first");
  EXPECT_EQ(run.report().query, 20 + 2 * kViews - 1);
}

TEST(DetectorHostile, BlackFramesBetween) {
  TestRun run(small_config());
  const auto images = laps_of(walk(static_cast<int>(kViews)), 2);
  for (std::size_t i = 0; i < images.size(); ++i) {
    EXPECT_EQ(run.see(Image(320, 240, 255)).outcome, Outcome::kNoFeatures);
    EXPECT_EQ(run.see(images[i]).outcome == Outcome::kLoop, i >= kViews) << i;
  }
}

TEST(DetectorHostile, FewFeaturesAreNone) {
  Image image(320, 240, 100);
  image.fill(100, 100, 140, 140, 180);  // four lines and a few corners
  Config config = small_config();
  config.features.min_features = 1000;
  TestRun run(config);
  const Report& r = run.see(image);
  EXPECT_EQ(r.outcome, Outcome::kNoFeatures);
  EXPECT_GT(r.points + r.lines, 0);
}

TEST(DetectorHostile, OnePixel) {
  TestRun run(small_config());
  for (int i = 0; i < 5; ++i) EXPECT_EQ(run.see(Image(1, 1, 200)).outcome, Outcome::kNoFeatures);
  expect_works(run, "one pixel");
}

TEST(DetectorHostile, FortyEightMegapixels) {
  Image image(8000, 6000, 90);
  const Image wall = wall_image(1, 0, 800, 600);
  for (int y = 0; y < image.height_px; ++y)
    for (int x = 0; x < image.width_px; ++x) image.at(x, y) = wall.at(x / 10, y / 10);
  TestRun run(small_config());
  const Report& r = run.see(image);
  EXPECT_EQ(r.outcome, Outcome::kMapEmpty);
  EXPECT_GT(r.points, 100);
  EXPECT_GT(r.lines, 50);
  const Features* features = run.detector.features(r.query);
  ASSERT_NE(features, nullptr);
  EXPECT_EQ(features->width_px, 8000);
  float farthest = 0;  // full-resolution pixels
  for (const Point& p : features->points) farthest = std::max(farthest, p.x_px);
  EXPECT_GT(farthest, 6000.0F);
  EXPECT_LT(farthest, 8000.0F);
  expect_works(run, "48 megapixels");
}

TEST(DetectorHostile, SizesChangeFromFrameToFrame) {
  const std::vector<std::pair<int, int>> sizes = {
      {320, 240}, {1, 1},   {240, 320}, {16, 16}, {15, 400},  {1000, 3}, {64, 64},
      {63, 65},   {2, 500}, {640, 480}, {1, 700}, {317, 239}, {700, 1},  {100, 100}};
  TestRun run(small_config());
  TestRun again(small_config());
  for (unsigned i = 0; i < 4 * sizes.size(); ++i) {
    const auto [width, height] = sizes[i % sizes.size()];
    const Image image = wall_image(i % 19, static_cast<int>(i), width, height);
    const Report& r = run.see(image);
    EXPECT_NE(r.outcome, Outcome::kError) << width << " x " << height;
    EXPECT_EQ(text_of(r), text_of(again.see(image)));
  }
  expect_works(run, "changing sizes");
}

TEST(DetectorHostile, TheSamePlaceInAnotherSizeIsNoReasonToFail) {
  TestRun run(small_config());
  for (const Image& image : laps_of(walk(static_cast<int>(kViews)), 1)) run.see(image);
  for (const Image& image : laps_of(walk(static_cast<int>(kViews)), 1, 200, 240)) {
    const Report& r = run.see(image);
    EXPECT_FALSE(r.still);
    EXPECT_NE(r.outcome, Outcome::kError);
  }
}

TEST(DetectorHostile, PureNoiseIsNoPlace) {
  TestRun run(small_config());
  for (unsigned i = 0; i < 30; ++i) {
    const Report& r = run.see(testing::with_noise(Image(320, 240, 128), 60, i));
    EXPECT_NE(r.outcome, Outcome::kLoop) << i;
    EXPECT_NE(r.outcome, Outcome::kError) << i;
  }
}

TEST(DetectorHostile, ARegularPatternIsAnswered) {
  TestRun run(small_config());
  for (int i = 0; i < 30; ++i) {
    Image grid(320, 240, 40);
    const int cell = 8 + i % 5;
    for (int y = 0; y < 240; ++y)
      for (int x = 0; x < 320; ++x)
        if (((x + 2 * i) / cell + y / cell) % 2 == 0) grid.at(x, y) = 220;
    EXPECT_NE(run.see(grid).outcome, Outcome::kError) << i;
  }
}

// ---- Features that were not made by us

Features described(unsigned wall) {
  Detector detector(small_config());
  const auto report = std::make_unique<Report>();
  detector.process(wall_image(wall).frame(0), *report);
  return *detector.features(0);
}

/// Gives `odd` again and again between ordinary places; nothing may fail but those frames.
void expect_answered(const Features& odd, const char* what) {
  TestRun run(small_config());
  for (int i = 0; i < 8; ++i) {
    run.see(odd);
    run.see(described(50 + static_cast<unsigned>(i)));
  }
  for (int i = 0; i < 3; ++i) run.see(odd);
  expect_works(run, what);
}

TEST(DetectorHostile, FeaturesOfAnEmptyImage) {
  Features odd = described(1);
  odd.width_px = odd.height_px = 0;
  expect_answered(odd, "size 0 x 0");
}

TEST(DetectorHostile, FeaturesOfAnImageOfNegativeSize) {
  Features odd = described(1);
  odd.width_px = odd.height_px = -1000;
  expect_answered(odd, "negative size");
}

TEST(DetectorHostile, FeaturesOutsideTheImage) {
  Features odd = described(1);
  for (Point& p : odd.points) p.x_px = p.x_px * 1000 - 100'000;
  for (Line& line : odd.lines) line.end_y_px = line.end_y_px * 1000 - 100'000;
  expect_answered(odd, "outside");
}

TEST(DetectorHostile, FeaturesAllInOnePlace) {
  Features odd = described(1);
  for (Point& p : odd.points) p = odd.points[0];
  for (Line& line : odd.lines) line = {5, 5, 5, 5};
  expect_answered(odd, "one place");
}

TEST(DetectorHostile, FeaturesAllAlike) {
  Features odd = described(1);
  for (Descriptor& d : odd.point_descriptors) d = {};
  for (Descriptor& d : odd.line_descriptors) d = {};
  expect_answered(odd, "one descriptor");
}

TEST(DetectorHostile, FeaturesThatAreNoNumbers) {
  using Limits = std::numeric_limits<float>;
  for (const float value :
       {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity(), Limits::max()}) {
    Features odd = described(1);
    for (std::size_t i = 0; i < odd.points.size(); i += 2) odd.points[i].x_px = value;
    for (std::size_t i = 0; i < odd.points.size(); i += 3) odd.points[i].size_px = value;
    for (std::size_t i = 0; i < odd.points.size(); i += 5) odd.points[i].angle_deg = value;
    for (std::size_t i = 0; i < odd.lines.size(); i += 2) odd.lines[i].start_y_px = value;
    expect_answered(odd, "not a number");
  }
}

}  // namespace
}  // namespace loopd
