#include "features/lbd.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/hamming.h"
#include "support/scene_image.h"

namespace loopd {
namespace {

using testing::Image;
using testing::wall_image;

Image turned_180(const Image& image) {
  Image turned = image;
  std::reverse(turned.pixels.begin(), turned.pixels.end());
  return turned;
}

Line turned_180(const Line& line, const Image& image) {
  const auto right = static_cast<float>(image.width_px - 1);
  const auto bottom = static_cast<float>(image.height_px - 1);
  return {right - line.start_x_px, bottom - line.start_y_px, right - line.end_x_px,
          bottom - line.end_y_px};
}

Descriptor describe(const Image& image, const Line& line) {
  GradientImage gradient;
  gradient.compute(image.view());
  Descriptor descriptor;
  describe_lines(gradient, {&line, 1}, {&descriptor, 1});
  return descriptor;
}

TEST(Gradient, IsSobelInsideAndZeroAtTheBorder) {
  Image ramp(16, 16);
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 16; ++x) ramp.at(x, y) = static_cast<std::uint8_t>(4 * x);
  GradientImage gradient;
  gradient.compute(ramp.view());
  EXPECT_EQ(gradient.at(8, 8).x, 32);  // 8 times the slope of 4 a pixel
  EXPECT_EQ(gradient.at(8, 8).y, 0);
  EXPECT_EQ(gradient.at(0, 8).x, 0);
}

TEST(DirectByContrast, PutsTheDarkSideOnTheRightWhicheverWayTheLineCame) {
  Image image(64, 64, 200);
  image.fill(0, 32, 64, 64, 20);  // dark below
  GradientImage gradient;
  gradient.compute(image.view());
  Line lines[] = {{10, 31.5F, 50, 31.5F}, {50, 31.5F, 10, 31.5F}};
  direct_by_contrast(gradient, lines);
  for (const Line& line : lines) {  // walking right on the screen, below is the right-hand side
    EXPECT_EQ(line.start_x_px, 10);
    EXPECT_EQ(line.end_x_px, 50);
  }
}

TEST(Lbd, IsTheSameInARolledImage) {
  const Image image = wall_image(3);
  const Line line{60, 100, 200, 130};
  const int distance =
      hamming_distance(describe(image, line), describe(turned_180(image), turned_180(line, image)));
  EXPECT_LE(distance, 12);
}

TEST(Lbd, SurvivesASmallShiftAndTellsOtherLinesApart) {
  const Image image = wall_image(3);
  const Image shifted = wall_image(3, 10);
  const Line line{60, 100, 200, 130};
  const Line same{50, 100, 190, 130};
  const Line other{60, 180, 200, 150};
  const Descriptor descriptor = describe(image, line);
  EXPECT_LE(hamming_distance(descriptor, describe(shifted, same)), 8);
  EXPECT_GE(hamming_distance(descriptor, describe(image, other)), 40);
}

TEST(Lbd, AnswersDegenerateLines) {
  const Image image = wall_image(5, 0, 32, 32);
  for (const Line& line : {Line{5, 5, 5, 5}, Line{-100, -100, 500, 400}, Line{31, 31, 31, 0}})
    EXPECT_EQ(describe(image, line), describe(image, line));
}

}  // namespace
}  // namespace loopd
