#include "features/lbd.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

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
  for (const Line& line : {Line{5, 5, 5, 5}, Line{-100, -100, 500, 400}, Line{31, 31, 31, 0},
                           Line{-1e30F, 5, 1e30F, 7}, Line{3e9F, 3e9F, 3e9F, 3.1e9F}})
    EXPECT_EQ(describe(image, line), describe(image, line));
  EXPECT_EQ(describe(Image(1, 1), Line{0, 0, 0, 9}), describe(Image(1, 1), Line{0, 0, 0, 9}));
}

std::vector<Line> random_lines(int count, int width, int height) {
  std::mt19937 random(11);
  const auto below = [&](int n) {
    return static_cast<float>(random() % static_cast<unsigned>(16 * n)) / 16 - 4;
  };
  std::vector<Line> lines;
  for (int i = 0; i < count; ++i)
    lines.push_back({below(width + 8), below(height + 8), below(width + 8), below(height + 8)});
  return lines;
}

// The descriptor as the paper has it, one sample after the other in double precision.
Descriptor by_definition(const GradientImage& gradient, const Line& line) {
  const double length =
      std::hypot(line.end_x_px - line.start_x_px, line.end_y_px - line.start_y_px);
  const double dx = (line.end_x_px - line.start_x_px) / length;
  const double dy = (line.end_y_px - line.start_y_px) / length;
  const int samples = std::min(48, 4 * (static_cast<int>(length / 6) + 1));
  double rows[63][4] = {};
  for (int row = 0; row < 63; ++row)
    for (int i = 0; i < samples; ++i) {
      const double along_px = (i + 0.5) * length / samples;
      const double x = line.start_x_px + along_px * dx - (row - 31) * dy;
      const double y = line.start_y_px + along_px * dy + (row - 31) * dx;
      const auto& g =
          gradient.at(std::clamp(static_cast<int>(std::floor(x + 0.5)), 0, gradient.width_px - 1),
                      std::clamp(static_cast<int>(std::floor(y + 0.5)), 0, gradient.height_px - 1));
      const double across = g.y * dx - g.x * dy;
      const double along = g.x * dx + g.y * dy;
      const double weight = std::exp(-(row - 31) * (row - 31) / (2 * 31.0 * 31.0));
      rows[row][across > 0 ? 0 : 1] += weight * std::abs(across);
      rows[row][along > 0 ? 2 : 3] += weight * std::abs(along);
    }
  double values[9][8] = {};
  for (int band = 0; band < 9; ++band)
    for (int k = 0; k < 4; ++k) {
      double sum = 0;
      double squares = 0;
      int count = 0;
      for (int row = std::max(0, 7 * (band - 1)); row < std::min(63, 7 * (band + 2)); ++row) {
        const int from_centre = row - 7 * band - 3;
        const double value = rows[row][k] * std::exp(-from_centre * from_centre / (2 * 7.0 * 7.0));
        sum += value;
        squares += value * value;
        ++count;
      }
      values[band][2 * k] = sum / count;
      values[band][2 * k + 1] =
          std::sqrt(std::max(0.0, squares / count - sum / count * sum / count));
    }
  Descriptor descriptor;
  std::size_t bit = 0;
  for (int apart = 1; apart < 9; ++apart)
    for (int a = 0; a + apart < 9 && bit < 256; ++a)
      for (int k = 0; k < 8; ++k, ++bit)
        if (values[a][k] > values[a + apart][k])
          descriptor.words[bit / 64] |= std::uint64_t{1} << (bit % 64);
  return descriptor;
}

TEST(Lbd, IsTheDefinition) {
  const Image image = testing::with_noise(wall_image(8), 4, 1);
  GradientImage gradient;
  gradient.compute(image.view());
  int different = 0;
  int lines = 0;
  for (const Line& line : random_lines(200, image.width_px, image.height_px)) {
    if (std::hypot(line.end_x_px - line.start_x_px, line.end_y_px - line.start_y_px) < 10) continue;
    const int distance = hamming_distance(describe(image, line), by_definition(gradient, line));
    EXPECT_LE(distance, 10);  // bands that are nearly equal, samples between two pixels
    different += distance;
    ++lines;
  }
  EXPECT_LE(different, lines);  // one bit of 256 on average
}

TEST(Lbd, EveryFormGivesTheSameBits) {
  const Image image = testing::with_noise(wall_image(8), 30, 1);
  GradientImage gradient;
  gradient.compute(image.view());
  const auto lines = random_lines(300, image.width_px, image.height_px);
  std::vector<Descriptor> fast(lines.size());
  std::vector<Descriptor> plain(lines.size());
  describe_lines(gradient, lines, fast);
  describe_lines_plainly(gradient, lines, plain);
  EXPECT_EQ(fast, plain);
}

}  // namespace
}  // namespace loopd
