#include "features/feature_extractor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/scene_image.h"

namespace loopd {
namespace {

using testing::Image;
using testing::wall_image;

Features extract(const Image& image, FeaturesConfig config = {}) {
  FeatureExtractor extractor(config);
  Features features;
  extractor.prepare(image.view(), features);
  extractor.extract_points(features);
  extractor.extract_lines(features);
  return features;
}

float length(const Line& line) {
  return std::hypot(line.end_x_px - line.start_x_px, line.end_y_px - line.start_y_px);
}

bool joins(const Line& line, float x0, float y0, float x1, float y1, float tolerance_px = 4) {
  const auto near = [=](float a, float b) { return std::abs(a - b) <= tolerance_px; };
  const auto matches = [&](float ax, float ay, float bx, float by) {
    return near(line.start_x_px, ax) && near(line.start_y_px, ay) && near(line.end_x_px, bx) &&
           near(line.end_y_px, by);
  };
  return matches(x0, y0, x1, y1) || matches(x1, y1, x0, y0);
}

TEST(FeatureExtractor, FindsTheFourSidesOfARectangleLongestFirst) {
  Image image(320, 240, 200);
  image.fill(80, 60, 240, 160, 40);
  const Features features = extract(image);
  for (const auto& side : {std::array{80.F, 60.F, 240.F, 60.F},
                           {80.F, 160.F, 240.F, 160.F},
                           {80.F, 60.F, 80.F, 160.F},
                           {240.F, 60.F, 240.F, 160.F}})
    EXPECT_TRUE(std::any_of(
        features.lines.begin(), features.lines.end(),
        [&](const Line& line) { return joins(line, side[0], side[1], side[2], side[3]); }))
        << side[0] << "," << side[1] << " to " << side[2] << "," << side[3];
  for (std::size_t i = 1; i < features.lines.size(); ++i)
    EXPECT_GE(length(features.lines[i - 1]) + 1e-3F, length(features.lines[i]));
}

TEST(FeatureExtractor, GivesADescriptorForEachFeatureAndKeepsToItsBounds) {
  FeaturesConfig config;
  config.points = 200;
  config.lines = 30;
  const Features features = extract(wall_image(1), config);
  EXPECT_EQ(features.points.size(), features.point_descriptors.size());
  EXPECT_EQ(features.lines.size(), features.line_descriptors.size());
  EXPECT_GT(features.points.size(), 100U);
  EXPECT_LE(features.points.size(), 200U);
  EXPECT_EQ(features.lines.size(), 30U);
}

TEST(FeatureExtractor, ZeroOfAKindTurnsItOff) {
  FeaturesConfig config;
  config.lines = 0;
  EXPECT_TRUE(extract(wall_image(1), config).lines.empty());
  config = {};
  config.points = 0;
  EXPECT_TRUE(extract(wall_image(1), config).points.empty());
}

TEST(FeatureExtractor, SaysNothingAboutNothing) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 500}, {500, 1}, {15, 15}, {40, 40}}) {
    const Features features = extract(Image(width, height, 90));
    EXPECT_TRUE(features.points.empty()) << width << "x" << height;
    EXPECT_TRUE(features.lines.empty()) << width << "x" << height;
  }
  const Features black = extract(Image(640, 480));
  EXPECT_TRUE(black.points.empty());
  EXPECT_TRUE(black.lines.empty());
}

TEST(FeatureExtractor, ReportsFullResolutionPixelsOfAReducedImage) {
  Image image(640, 480, 200);
  image.fill(160, 120, 480, 320, 40);
  FeaturesConfig config;
  config.max_pixels = 320 * 240;
  const Features features = extract(image, config);
  EXPECT_EQ(features.width_px, 640);
  EXPECT_TRUE(std::any_of(features.lines.begin(), features.lines.end(), [](const Line& line) {
    return joins(line, 159.5F, 119.5F, 479.5F, 119.5F, 6);  // 2.5 px where it is found
  }));
  const auto near_corner = [](const Point& p) {
    return std::hypot(p.x_px - 160, p.y_px - 120) < 8;
  };
  EXPECT_TRUE(std::any_of(features.points.begin(), features.points.end(), near_corner));
}

TEST(FeatureExtractor, IsTheSameEveryTime) {
  const Features a = extract(wall_image(9));
  const Features b = extract(wall_image(9));
  EXPECT_EQ(a.point_descriptors, b.point_descriptors);
  EXPECT_EQ(a.line_descriptors, b.line_descriptors);
}

}  // namespace
}  // namespace loopd
