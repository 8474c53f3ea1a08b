#include "loop/stillness.h"

#include <gtest/gtest.h>

#include "features/feature_extractor.h"
#include "support/scene_image.h"

namespace loopd {
namespace {

using testing::Image;
using testing::wall_image;
using testing::with_noise;

LoopConfig still_config() {
  LoopConfig config;
  config.still_fraction = 0.75;
  config.still_radius_px = 1.0;
  return config;
}

/// Features of images, with more points than lines or lines alone.
class Describer {
 public:
  explicit Describer(int points = 400) : extractor_(config(points)) {}

  Features operator()(const Image& image) {
    Features features;
    extractor_.prepare(image.view(), features);
    extractor_.extract_points(features);
    extractor_.extract_lines(features);
    return features;
  }

 private:
  static FeaturesConfig config(int points) {
    FeaturesConfig config;
    config.points = points;
    config.lines = 150;
    config.max_pixels = 1'000'000;
    config.fast_threshold = 12;
    config.scale_factor = 1.2;
    config.levels = 6;
    config.min_line_length = 0.03;
    return config;
  }
  FeatureExtractor extractor_;
};

/// `image` with everything from column `x` on replaced by what `other` shows there.
Image covered_from(Image image, int x, const Image& other) {
  for (int y = 0; y < image.height_px; ++y)
    for (int column = x; column < image.width_px; ++column)
      image.at(column, y) = other.at(column, y);
  return image;
}

/// True with points and lines, and with lines alone.
class Stillness : public ::testing::TestWithParam<int> {
 protected:
  bool is_still(const Image& before, const Image& now) {
    return test_.is_still(describe_(before), describe_(now));
  }
  Describer describe_{GetParam()};
  StillnessTest test_{still_config()};
};

TEST_P(Stillness, TheSameImageIsStill) {
  for (unsigned wall = 1; wall <= 5; ++wall)
    EXPECT_TRUE(is_still(wall_image(wall), wall_image(wall))) << wall;
}

TEST_P(Stillness, NoiseIsStill) {
  for (unsigned wall = 1; wall <= 5; ++wall)
    for (int sigma = 1; sigma <= 6; ++sigma)
      EXPECT_TRUE(is_still(with_noise(wall_image(wall), sigma, 100 * wall),
                           with_noise(wall_image(wall), sigma, 100 * wall + 1)))
          << "wall " << wall << ", sigma " << sigma;
}

TEST_P(Stillness, AShiftOfThreePixelsIsNot) {
  for (unsigned wall = 1; wall <= 5; ++wall)
    for (const int shift : {3, -3, 6, 20})
      EXPECT_FALSE(is_still(with_noise(wall_image(wall), 2, wall),
                            with_noise(wall_image(wall, shift), 2, wall + 1)))
          << "wall " << wall << ", shift " << shift;
}

TEST_P(Stillness, AnotherWallIsNot) {
  for (unsigned wall = 1; wall <= 5; ++wall)
    EXPECT_FALSE(is_still(wall_image(wall), wall_image(wall + 10))) << wall;
}

TEST_P(Stillness, SomethingInFrontOfHalfTheImageDoesNotCount) {
  for (unsigned wall = 1; wall <= 5; ++wall) {
    const Image before = with_noise(wall_image(wall), 2, wall);
    const Image now = with_noise(
        covered_from(wall_image(wall), wall_image(wall).width_px / 2, wall_image(wall + 10)), 2,
        wall + 1);
    EXPECT_TRUE(is_still(before, now)) << wall;
    EXPECT_TRUE(is_still(now, before)) << wall;
  }
}

TEST_P(Stillness, AnotherImageSizeIsNot) {
  Features before = describe_(wall_image(1));
  Features now = before;
  now.width_px += 1;
  EXPECT_FALSE(test_.is_still(before, now));
  now = before;
  now.height_px -= 1;
  EXPECT_FALSE(test_.is_still(before, now));
}

TEST_P(Stillness, NothingToSeeIsNot) {
  const Features wall = describe_(wall_image(1));
  Features nothing;
  nothing.width_px = wall.width_px;
  nothing.height_px = wall.height_px;
  EXPECT_FALSE(test_.is_still(nothing, nothing));
  EXPECT_FALSE(test_.is_still(wall, nothing));
  EXPECT_FALSE(test_.is_still(nothing, wall));
  EXPECT_FALSE(test_.is_still(Features{}, Features{}));
}

TEST_P(Stillness, EarlierAnswersDoNotMatter) {
  const Features wall = describe_(wall_image(1));
  const Features large = describe_(wall_image(2, 0, 640, 480));
  const Features small = describe_(wall_image(3, 0, 100, 80));
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE(test_.is_still(wall, wall));
    EXPECT_TRUE(test_.is_still(large, large));
    EXPECT_FALSE(test_.is_still(wall, small));
    EXPECT_TRUE(test_.is_still(small, small));
  }
}

INSTANTIATE_TEST_SUITE_P(Features, Stillness, ::testing::Values(400, 0), [](const auto& param) {
  return param.param == 0 ? "LinesOnly" : "PointsAndLines";
});

TEST(StillnessOfPoints, WorksWithoutLines) {
  Describer describe;
  StillnessTest test(still_config());
  const auto points_of = [&](const Image& image) {
    Features features = describe(image);
    features.lines.clear();
    features.line_descriptors.clear();
    return features;
  };
  const Features before = points_of(with_noise(wall_image(1), 3, 1));
  EXPECT_TRUE(test.is_still(before, points_of(with_noise(wall_image(1), 3, 2))));
  EXPECT_FALSE(test.is_still(before, points_of(with_noise(wall_image(1, 3), 3, 2))));
}

}  // namespace
}  // namespace loopd
