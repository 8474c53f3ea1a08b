#include "features/gradient_image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "support/scene_image.h"

namespace loopd {
namespace {

using testing::Image;

constexpr int kDerivative[] = {-1, -2, 0, 2, 1};
constexpr int kSmoothing[] = {1, 4, 6, 4, 1};

// Both 5x5 kernels written out.
GradientImage::Gradient by_definition(const LumaView& image, int x, int y) {
  int gx = 0;
  int gy = 0;
  for (int j = -2; j <= 2; ++j)
    for (int i = -2; i <= 2; ++i) {
      const int pixel = image.data[(y + j) * image.stride_bytes + x + i];
      gx += kDerivative[i + 2] * kSmoothing[j + 2] * pixel;
      gy += kSmoothing[i + 2] * kDerivative[j + 2] * pixel;
    }
  return {static_cast<std::int16_t>(gx), static_cast<std::int16_t>(gy)};
}

void expect_definition(const LumaView& image) {
  GradientImage gradient;
  gradient.compute(image);
  int wrong = 0;
  for (int y = 0; y < image.height_px; ++y)
    for (int x = 0; x < image.width_px; ++x) {
      const bool inside = x >= 2 && y >= 2 && x + 2 < image.width_px && y + 2 < image.height_px;
      const auto expected = inside ? by_definition(image, x, y) : GradientImage::Gradient{};
      wrong += gradient.at(x, y).x != expected.x || gradient.at(x, y).y != expected.y;
    }
  EXPECT_EQ(wrong, 0) << image.width_px << "x" << image.height_px;
}

TEST(GradientImage, IsTheKernelInsideAndZeroAtTheBorder) {
  for (const auto& [width, height] :
       {std::pair{64, 48}, {63, 5}, {5, 63}, {17, 9}, {4, 40}, {40, 4}, {1, 1}})
    expect_definition(testing::with_noise(testing::wall_image(2, 0, width, height), 20, 1).view());
}

TEST(GradientImage, TakesRowsThatAreApart) {
  const Image image = testing::with_noise(testing::wall_image(4, 0, 80, 40), 20, 1);
  LumaView part = image.view();
  part.width_px = 33;
  expect_definition(part);
}

TEST(GradientImage, HasRoomForTheSteepestStep) {
  Image image(16, 16);
  image.fill(8, 0, 16, 16, 255);
  GradientImage gradient;
  gradient.compute(image.view());
  EXPECT_EQ(gradient.at(8, 8).x, GradientImage::kLargest);
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 16; ++x) image.at(x, y) = static_cast<std::uint8_t>(4 * x);
  gradient.compute(image.view());
  EXPECT_EQ(gradient.at(8, 8).x, 4 * GradientImage::kUnit);
  EXPECT_EQ(gradient.at(8, 8).y, 0);
}

}  // namespace
}  // namespace loopd
