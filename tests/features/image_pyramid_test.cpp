#include "features/image_pyramid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/scene_image.h"

namespace loopd {
namespace {

using testing::Image;
using testing::wall_image;
using testing::with_noise;

int pixel(const LumaView& view, int x, int y) {
  return view.data[static_cast<std::ptrdiff_t>(y) * view.stride_bytes + x];
}

// The same by the definition: position to 1/256, columns mixed first, then each row.
int reference(const LumaView& from, const LumaView& to, int x, int y) {
  const auto position = [](int at, int from_px, int to_px) {
    const double centre = std::floor((at + 0.5) * from_px / to_px * 256 - 128 + 1e-9);
    return std::clamp(static_cast<int>(centre), 0, (from_px - 1) * 256);
  };
  const int px = position(x, from.width_px, to.width_px);
  const int py = position(y, from.height_px, to.height_px);
  const auto next = [](int at, int size_px) { return std::min(at + 1, size_px - 1); };
  const auto column = [&](int cx) {
    const int a = pixel(from, cx, py / 256);
    const int b = pixel(from, cx, next(py / 256, from.height_px));
    return (a * (256 - py % 256) + b * (py % 256) + 128) / 256;
  };
  const int a = column(px / 256), b = column(next(px / 256, from.width_px));
  return (a * (256 - px % 256) + b * (px % 256) + 128) / 256;
}

TEST(ImagePyramid, EachLevelIsTheBilinearReductionOfTheOneBeforeInEveryForm) {
  const Image image = with_noise(wall_image(3, 0, 317, 203), 20, 1);
  for (const SimdForm form : simd_forms())
    for (const double scale : {1.05, 1.2, 1.5, 2.0, 3.7}) {
      ImagePyramid pyramid(form);
      pyramid.build(image.view(), scale, 5);
      for (int i = 1; i < pyramid.levels(); ++i) {
        const LumaView from = pyramid.level(i - 1), to = pyramid.level(i);
        EXPECT_EQ(to.width_px, static_cast<int>(317 / std::pow(scale, i) + 0.5));
        int wrong = 0;
        for (int y = 0; y < to.height_px; ++y)
          for (int x = 0; x < to.width_px; ++x)
            wrong += pixel(to, x, y) != reference(from, to, x, y);
        EXPECT_EQ(wrong, 0) << "scale " << scale << ", level " << i;
      }
    }
}

TEST(ImagePyramid, KeepsTheMiddleOfTheImageInTheMiddle) {
  Image ramp(200, 100);
  for (int y = 0; y < 100; ++y)
    for (int x = 0; x < 200; ++x) ramp.at(x, y) = static_cast<std::uint8_t>(x + y / 2);
  ImagePyramid pyramid;
  pyramid.build(ramp.view(), 1.2, 4);
  for (int i = 1; i < 4; ++i) {
    const LumaView level = pyramid.level(i);
    const double x = (20 + 0.5) * 200 / level.width_px - 0.5;
    const double y = (10 + 0.5) * 100 / level.height_px - 0.5;
    EXPECT_NEAR(pixel(level, 20, 10), x + y / 2, 1.5) << i;
  }
}

TEST(ImagePyramid, Level1ComesFirstAndLevel0IsTheCallersImage) {
  const Image image = wall_image(1);
  ImagePyramid pyramid;
  pyramid.start(image.view(), 1.2, 3);
  EXPECT_EQ(pyramid.level(0).data, image.pixels.data());
  EXPECT_EQ(pyramid.built(), 1);
  pyramid.build_next();
  EXPECT_EQ(pyramid.built(), 2);
  EXPECT_EQ(pyramid.level(1).width_px, 267);
}

TEST(ImagePyramid, TakesTheSmallestImagesAndWideRows) {
  for (const SimdForm form : simd_forms())
    for (const auto& [width, height] : {std::pair{1, 1}, {1, 90}, {90, 1}, {2, 2}, {31, 5}}) {
      const Image image(width, height, 77);
      ImagePyramid pyramid(form);
      pyramid.build(image.view(), 2.0, 12);
      const LumaView last = pyramid.level(11);
      EXPECT_EQ(pixel(last, last.width_px - 1, last.height_px - 1), 77);
    }
  Image wide = wall_image(5);
  const LumaView part{wide.pixels.data() + 10, 100, 100, wide.width_px};
  ImagePyramid pyramid;
  pyramid.build(part, 1.2, 2);
  EXPECT_EQ(pixel(pyramid.level(1), 40, 60), reference(part, pyramid.level(1), 40, 60));
}

TEST(ImagePyramid, ForgetsTheImageBefore) {
  ImagePyramid used, fresh;
  const Image large = wall_image(1, 0, 400, 300), small = wall_image(2, 0, 99, 131);
  used.build(large.view(), 1.2, 8);
  used.build(small.view(), 1.3, 4);
  fresh.build(small.view(), 1.3, 4);
  ASSERT_EQ(used.levels(), 4);
  for (int i = 1; i < 4; ++i) {
    const LumaView a = used.level(i), b = fresh.level(i);
    ASSERT_EQ(a.width_px, b.width_px);
    for (int y = 0; y < a.height_px; ++y)
      for (int x = 0; x < a.width_px; ++x) ASSERT_EQ(pixel(a, x, y), pixel(b, x, y));
  }
}

}  // namespace
}  // namespace loopd
