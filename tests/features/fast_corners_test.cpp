#include "features/fast_corners.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>

#include "support/scene_image.h"

namespace loopd {
namespace {

using testing::Image;
using testing::wall_image;
using testing::with_noise;

// FAST by its definition: nine pixels in a row on the circle all brighter, or all darker.
bool is_corner(const Image& image, int x, int y, int threshold) {
  static constexpr std::array<std::array<int, 2>, 16> kCircle{{{0, -3},
                                                               {1, -3},
                                                               {2, -2},
                                                               {3, -1},
                                                               {3, 0},
                                                               {3, 1},
                                                               {2, 2},
                                                               {1, 3},
                                                               {0, 3},
                                                               {-1, 3},
                                                               {-2, 2},
                                                               {-3, 1},
                                                               {-3, 0},
                                                               {-3, -1},
                                                               {-2, -2},
                                                               {-1, -3}}};
  const int centre = image.at(x, y);
  for (std::size_t start = 0; start < 16; ++start) {
    bool brighter = true, darker = true;
    for (std::size_t i = 0; i < 9; ++i) {
      const auto& step = kCircle[(start + i) % 16];
      const int value = image.at(x + step[0], y + step[1]);
      brighter = brighter && value > centre + threshold;
      darker = darker && value < centre - threshold;
    }
    if (brighter || darker) return true;
  }
  return false;
}

// The largest threshold at which it is a corner, plus one; 0 if not even at `threshold`.
int score(const Image& image, int x, int y, int threshold) {
  if (!is_corner(image, x, y, threshold)) return 0;
  int best = threshold;
  while (is_corner(image, x, y, best)) ++best;
  return best;
}

std::vector<Corner> reference(const Image& image, int border, int threshold) {
  const int width = image.width_px, height = image.height_px;
  std::vector<int> scores(static_cast<std::size_t>(width * height), 0);
  const auto at = [&](int x, int y) -> int& {
    return scores[static_cast<std::size_t>(y * width + x)];
  };
  for (int y = 3; y < height - 3; ++y)
    for (int x = 3; x < width - 3; ++x) at(x, y) = score(image, x, y, threshold);
  std::vector<Corner> corners;
  for (int y = border; y < height - border; ++y)
    for (int x = border; x < width - border; ++x) {
      bool largest = at(x, y) > 0;
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
          const bool earlier = dy < 0 || (dy == 0 && dx < 0);
          if (dx == 0 && dy == 0) continue;
          largest =
              largest && (earlier ? at(x, y) > at(x + dx, y + dy) : at(x, y) >= at(x + dx, y + dy));
        }
      if (largest) corners.push_back({x, y, static_cast<float>(at(x, y))});
    }
  return corners;
}

void expect_as_defined(const Image& image, int border, int threshold, const char* what) {
  const std::vector<Corner> expected = reference(image, border, threshold);
  for (const SimdForm form : simd_forms()) {
    std::vector<Corner> corners;
    FastCorners(form).find(image.view(), border, threshold, corners);
    ASSERT_EQ(corners.size(), expected.size()) << what;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      ASSERT_EQ(corners[i].x_px, expected[i].x_px) << what << ", corner " << i;
      ASSERT_EQ(corners[i].y_px, expected[i].y_px) << what << ", corner " << i;
      ASSERT_EQ(corners[i].score, expected[i].score) << what << ", corner " << i;
    }
  }
}

Image checkerboard(int width, int height, int cell) {
  Image image(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) image.at(x, y) = ((x / cell + y / cell) % 2) != 0 ? 255 : 0;
  return image;
}

Image uniform_noise(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  Image image(width, height);
  for (std::uint8_t& pixel : image.pixels) pixel = static_cast<std::uint8_t>(random() % 256U);
  return image;
}

TEST(FastCorners, AreThoseOfTheDefinitionInEveryForm) {
  for (const int threshold : {1, 7, 20, 100, 254})
    expect_as_defined(with_noise(wall_image(4, 0, 171, 120), 6, 2), 16, threshold, "a wall");
  expect_as_defined(wall_image(4, 0, 171, 120), 31, 7, "a clean wall");
}

TEST(FastCorners, AreThoseOfTheDefinitionInHostileImages) {
  expect_as_defined(uniform_noise(131, 97, 1), 16, 7, "noise");
  for (const int cell : {1, 2, 3, 5, 8})
    expect_as_defined(checkerboard(120, 90, cell), 16, 7, "checkerboard");
  Image dots(140, 90, 10);  // equal neighbours, and contrasts of 255 both ways
  for (int y = 0; y < 90; y += 7)
    for (int x = 0; x < 140; x += 6) dots.fill(x, y, x + 2, y + 2, (x + y) % 4 == 0 ? 255 : 0);
  expect_as_defined(dots, 16, 7, "dots");
  expect_as_defined(Image(100, 80, 255), 16, 1, "white");
}

TEST(FastCorners, TakesEveryWidth) {
  for (int width = 33; width < 120; ++width)
    expect_as_defined(uniform_noise(width, 36, static_cast<unsigned>(width)), 16, 7, "width");
}

TEST(FastCorners, FindsNoneWithinTheBorderOfASmallImage) {
  std::vector<Corner> corners(3);
  for (const auto& [width, height] : {std::pair{1, 1}, {32, 200}, {200, 32}}) {
    FastCorners().find(uniform_noise(width, height, 1).view(), 16, 1, corners);
    EXPECT_TRUE(corners.empty()) << width << "x" << height;
  }
}

TEST(FastCorners, ForgetsTheImageBefore) {
  FastCorners used, fresh;
  std::vector<Corner> a, b;
  used.find(uniform_noise(200, 150, 1).view(), 16, 1, a);
  const Image wall = wall_image(6, 0, 150, 100);
  used.find(wall.view(), 16, 7, a);
  fresh.find(wall.view(), 16, 7, b);
  ASSERT_FALSE(b.empty());
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].x_px, b[i].x_px);
}

}  // namespace
}  // namespace loopd
