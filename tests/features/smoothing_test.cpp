#include "features/smoothing.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "support/scene_image.h"

namespace loopd {
namespace {

using testing::Image;
using testing::wall_image;
using testing::with_noise;

int reference(const Image& image, int x, int y) {
  int sum = 0;
  for (int dy = -3; dy <= 3; ++dy)
    for (int dx = -3; dx <= 3; ++dx)
      sum += (4 - std::abs(dx)) * (4 - std::abs(dy)) * image.at(x + dx, y + dy);
  return (sum + 128) / 256;
}

void expect_as_defined(const Image& image, int margin) {
  for (const SimdForm form : simd_forms()) {
    Smoothing smoothing(form);
    const LumaView smooth = smoothing.smooth(image.view(), margin);
    int wrong = 0;
    for (int y = margin; y < image.height_px - margin; ++y)
      for (int x = margin; x < image.width_px - margin; ++x)
        wrong += smooth.data[y * smooth.stride_bytes + x] != reference(image, x, y);
    EXPECT_EQ(wrong, 0) << image.width_px << "x" << image.height_px << ", margin " << margin;
  }
}

TEST(Smoothing, IsTheWeightedMeanInEveryForm) {
  expect_as_defined(with_noise(wall_image(1, 0, 203, 111), 30, 1), 3);
  expect_as_defined(with_noise(wall_image(1, 0, 203, 111), 30, 1), 15);
  for (int width = 7; width < 60; ++width)
    expect_as_defined(with_noise(wall_image(2, 0, width, 21), 60, 1), 3);
}

TEST(Smoothing, KeepsWhiteWhiteAndTakesImagesWithoutAnInside) {
  expect_as_defined(Image(64, 64, 255), 3);
  for (const auto& [width, height] : {std::pair{1, 1}, {6, 100}, {100, 6}})
    EXPECT_EQ(Smoothing().smooth(Image(width, height).view(), 3).width_px, width);
}

}  // namespace
}  // namespace loopd
