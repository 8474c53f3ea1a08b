#include "features/point_extractor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/features2d.hpp>
#include <random>

#include "base/hamming.h"
#include "support/scene_image.h"

namespace loopd {
namespace {

using testing::Image;
using testing::wall_image;
using testing::with_noise;

struct Found {
  std::vector<Point> points;
  std::vector<Descriptor> descriptors;
};

Found extract(const LumaView& image, FeaturesConfig config = {},
              SimdForm form = fastest_simd_form()) {
  Found found;
  PointExtractor(config, form).extract(image, found.points, found.descriptors);
  return found;
}

Found extract_by_opencv(const Image& image, const FeaturesConfig& config) {
  const cv::Mat pixels(image.height_px, image.width_px, CV_8UC1,
                       const_cast<std::uint8_t*>(image.pixels.data()));
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat table;
  cv::ORB::create(config.points, 1.2F, 8, 31, 0, 2, cv::ORB::HARRIS_SCORE, 31,
                  config.fast_threshold)
      ->detectAndCompute(pixels, cv::noArray(), keypoints, table);
  Found found;
  for (const cv::KeyPoint& k : keypoints) {
    found.points.push_back({k.pt.x, k.pt.y, k.size, k.angle});
    std::memcpy(found.descriptors.emplace_back().words.data(),
                table.ptr(static_cast<int>(found.points.size() - 1)), 32);
  }
  return found;
}

void expect_same(const Found& a, const Found& b) {
  ASSERT_EQ(a.points.size(), b.points.size());
  EXPECT_EQ(a.descriptors, b.descriptors);
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    ASSERT_EQ(a.points[i].x_px, b.points[i].x_px);
    ASSERT_EQ(a.points[i].y_px, b.points[i].y_px);
    ASSERT_EQ(a.points[i].size_px, b.points[i].size_px);
    ASSERT_EQ(a.points[i].angle_deg, b.points[i].angle_deg);
  }
}

// Matches by nearest neighbour and ratio between an image and the same `shift_px` further on, that
// are where the shift puts them.
int right_matches(const Found& a, const Found& b, float shift_px) {
  int right = 0;
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    int first = 1000, second = 1000;
    std::size_t best = 0;
    for (std::size_t k = 0; k < b.points.size(); ++k) {
      const int d = hamming_distance(a.descriptors[i], b.descriptors[k]);
      if (d < first) {
        second = first;
        first = d;
        best = k;
      } else {
        second = std::min(second, d);
      }
    }
    if (first > 0.8 * second) continue;
    const float tolerance = 2 * a.points[i].size_px / 31;
    right += std::abs(a.points[i].x_px - shift_px - b.points[best].x_px) < tolerance &&
             std::abs(a.points[i].y_px - b.points[best].y_px) < tolerance;
  }
  return right;
}

TEST(PointExtractor, MatchesShiftedNoisyImagesAsWellAsOpenCv) {
  FeaturesConfig config;
  config.points = 500;
  int ours = 0, opencv = 0;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Image a = with_noise(wall_image(seed), 4, seed);
    const Image b = with_noise(wall_image(seed, 24), 4, seed + 100);
    ours += right_matches(extract(a.view(), config), extract(b.view(), config), 24);
    opencv += right_matches(extract_by_opencv(a, config), extract_by_opencv(b, config), 24);
  }
  EXPECT_GT(opencv, 300);
  EXPECT_GE(ours, 0.95 * opencv);
}

TEST(PointExtractor, IsTheSameInEveryForm) {
  for (const SimdForm form : simd_forms()) {
    const Image image = with_noise(wall_image(3, 0, 411, 309), 10, 1);
    const Found found = extract(image.view(), {}, form);
    ASSERT_GT(found.points.size(), 500U);
    expect_same(found, extract(image.view(), {}, SimdForm::kBaseline));
  }
}

TEST(PointExtractor, KeepsToItsBoundsAndBorders) {
  const Image image = with_noise(wall_image(3, 0, 500, 400), 40, 1);
  for (const int points : {1, 10, 300, 1500, 10000}) {
    FeaturesConfig config;
    config.points = points;
    const Found found = extract(image.view(), config);
    ASSERT_LE(found.points.size(), static_cast<std::size_t>(points));
    if (points <= 1500) {
      EXPECT_EQ(found.points.size(), static_cast<std::size_t>(points));
    }
    for (const Point& p : found.points) {
      const float border = p.size_px - 2;
      EXPECT_GE(p.x_px, border);
      EXPECT_GE(p.y_px, border);
      EXPECT_LE(p.x_px, 500 - border);
      EXPECT_LE(p.y_px, 400 - border);
      EXPECT_GE(p.angle_deg, 0);
      EXPECT_LT(p.angle_deg, 360);
      const double level = std::log(p.size_px / 31) / std::log(1.2);
      EXPECT_NEAR(level, std::round(level), 1e-3);
    }
  }
}

TEST(PointExtractor, PutsAPointOfEveryLevelWhereTheCornerIs) {
  Image image(400, 400, 200);
  image.fill(200, 200, 400, 400, 30);  // its corner lies at 199.5, 199.5
  const Found found = extract(image.view());
  float largest = 0;
  for (const Point& p : found.points) {
    largest = std::max(largest, p.size_px);
    EXPECT_NEAR(p.x_px, 199.5, 1.6 * p.size_px / 31) << p.size_px;
    EXPECT_NEAR(p.y_px, 199.5, 1.6 * p.size_px / 31) << p.size_px;
  }
  EXPECT_GT(largest, 31 * 3.5F);
}

TEST(PointExtractor, TakesHostileImages) {
  std::mt19937 random(1);
  Image noise(300, 200), board(300, 200);
  for (std::uint8_t& pixel : noise.pixels) pixel = static_cast<std::uint8_t>(random() % 256U);
  for (int y = 0; y < 200; ++y)
    for (int x = 0; x < 300; ++x) board.at(x, y) = (x / 4 + y / 4) % 2 != 0 ? 255 : 0;
  for (const Image& image : {noise, board, Image(300, 200, 255), Image(63, 63, 9)}) {
    FeaturesConfig config;
    config.fast_threshold = 1;
    config.levels = 12;
    const Found found = extract(image.view(), config);
    EXPECT_LE(found.points.size(), 1500U);
    EXPECT_EQ(found.points.size(), found.descriptors.size());
  }
  EXPECT_TRUE(extract(Image(300, 200, 255).view()).points.empty());
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 4000}, {4000, 1}, {63, 63}, {64, 64}})
    EXPECT_TRUE(extract(Image(width, height, 50).view()).points.empty());
  for (const double scale : {1.05, 1.2, 2.0}) {
    FeaturesConfig config;
    config.scale_factor = scale;
    EXPECT_GT(extract(noise.view(), config).points.size(), 1000U) << scale;
  }
}

TEST(PointExtractor, TakesImagesWiderThanSixteenBits) {
  Image image(40000, 80, 200);
  image.fill(39900, 40, 40000, 80, 30);
  const Found found = extract(image.view());
  ASSERT_FALSE(found.points.empty());
  for (const Point& p : found.points) EXPECT_NEAR(p.x_px, 39899.5, 3);
}

TEST(PointExtractor, SeesOnlyThePixelsOfItsView) {
  const Image wide = with_noise(wall_image(4, 0, 400, 200), 5, 1);
  Image part(250, 200);
  for (int y = 0; y < 200; ++y)
    for (int x = 0; x < 250; ++x) part.at(x, y) = wide.at(x + 70, y);
  expect_same(extract({wide.pixels.data() + 70, 250, 200, 400}), extract(part.view()));
}

TEST(PointExtractor, ForgetsTheImageBefore) {
  PointExtractor used{FeaturesConfig{}};
  Found found;
  for (const auto& [width, height] : {std::pair{500, 400}, {80, 300}, {320, 240}}) {
    const Image image = wall_image(static_cast<unsigned>(width), 0, width, height);
    used.extract(image.view(), found.points, found.descriptors);
    expect_same(found, extract(image.view()));
  }
}

}  // namespace
}  // namespace loopd
