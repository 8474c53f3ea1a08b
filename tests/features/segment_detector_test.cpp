#include "features/segment_detector.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "support/scene_image.h"

namespace loopd {
namespace {

using testing::Image;
using testing::wall_image;

std::vector<Line> detect(const Image& image, float min_length_px = 12) {
  GradientImage gradient;
  gradient.compute(image.view());
  SegmentDetector detector;
  std::vector<Line> lines;
  detector.detect(gradient, min_length_px, lines);
  return lines;
}

float length(const Line& line) {
  return std::hypot(line.end_x_px - line.start_x_px, line.end_y_px - line.start_y_px);
}

// Grey by the signed distance of a pixel's centre to an edge, blended over one pixel.
template <class Distance>
Image drawn(int side, const Distance& distance, float dark, float light) {
  Image image(side, side);
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) {
      const float share =
          std::clamp(0.5F + distance(static_cast<float>(x), static_cast<float>(y)), 0.F, 1.F);
      image.at(x, y) = static_cast<std::uint8_t>(dark + (light - dark) * share + 0.5F);
    }
  return image;
}

// An edge through the whole image, light on the left of (cos, sin) when walking that way.
Image edge(float angle_rad, float offset_px, float dark = 60, float light = 160) {
  const float c = std::cos(angle_rad);
  const float s = std::sin(angle_rad);
  return drawn(
      160, [=](float x, float y) { return (x - 80) * s - (y - 80) * c + offset_px; }, dark, light);
}

TEST(SegmentDetector, FindsAnEdgeOfAnyDirectionInOnePieceAndToATenthOfAPixel) {
  for (int degrees = 0; degrees < 360; degrees += 5) {
    const float angle = static_cast<float>(degrees) * 0.017453293F;
    const float offset = static_cast<float>(degrees % 7) / 7;
    const auto lines = detect(edge(angle, offset));
    ASSERT_EQ(lines.size(), 1U) << degrees;
    const Line& line = lines[0];
    EXPECT_GT(length(line), 150) << degrees;
    const float c = std::cos(angle);
    const float s = std::sin(angle);
    for (const auto& [x, y] :
         {std::pair{line.start_x_px, line.start_y_px}, {line.end_x_px, line.end_y_px}})
      EXPECT_NEAR((x - 80) * s - (y - 80) * c + offset, 0, 0.1F) << degrees;
    // Directed by contrast: the dark side is on the right.
    EXPECT_GT((line.end_x_px - line.start_x_px) * c + (line.end_y_px - line.start_y_px) * s, 0)
        << degrees;
  }
}

TEST(SegmentDetector, FindsFaintEdgesInNoiseInOnePiece) {
  for (int degrees = 0; degrees < 180; degrees += 15) {
    const Image image =
        testing::with_noise(edge(static_cast<float>(degrees) * 0.017453293F, 0.3F, 100, 130), 3,
                            static_cast<unsigned>(degrees));
    const auto lines = detect(image, 30);
    ASSERT_EQ(lines.size(), 1U) << degrees;
    EXPECT_GT(length(lines[0]), 140) << degrees;
  }
}

TEST(SegmentDetector, BridgesGapsOfTwoPixelsButNotWideOnes) {
  Image image(160, 60, 40);
  image.fill(0, 30, 160, 60, 200);
  GradientImage gradient;
  gradient.compute(image.view());
  const auto erase = [&](int from, int to) {
    for (int y = 0; y < 60; ++y)
      for (int x = from; x < to; ++x) gradient.pixels[static_cast<std::size_t>(y * 160 + x)] = {};
  };
  SegmentDetector detector;
  std::vector<Line> lines;
  erase(80, 82);
  detector.detect(gradient, 12, lines);
  EXPECT_EQ(lines.size(), 1U);
  erase(76, 86);
  detector.detect(gradient, 12, lines);
  EXPECT_EQ(lines.size(), 2U);
}

TEST(SegmentDetector, PartsABentEdgeAtItsCorner) {
  // Two halves that meet at (80, 80), 16 degrees apart: within the growth's tolerance.
  const float slope = 0.14F;
  const Image image = drawn(
      160, [=](float x, float y) { return y - 80 - slope * std::abs(x - 80); }, 50, 180);
  const auto lines = detect(image, 30);
  ASSERT_EQ(lines.size(), 2U);
  for (const Line& line : lines) {
    const bool starts = std::abs(line.start_x_px - 80) < std::abs(line.end_x_px - 80);
    EXPECT_NEAR(starts ? line.start_x_px : line.end_x_px, 80, 8);
    const float found = (line.end_y_px - line.start_y_px) / (line.end_x_px - line.start_x_px);
    EXPECT_NEAR(std::abs(found), slope, 0.02F);
  }
}

TEST(SegmentDetector, TakesNoArcForALine) {
  const Image disc = drawn(
      160, [](float x, float y) { return 60 - std::hypot(x - 80, y - 80); }, 50, 180);
  // An arc of radius 60 that stays within 1.2 px of a line is 30 px long; noise of pixels adds
  // some.
  for (const Line& line : detect(disc)) EXPECT_LT(length(line), 37);
}

TEST(SegmentDetector, HasNoLineShorterThanAsked) {
  for (const float least : {0.F, 5.F, 20.F, 60.F})
    for (const Line& line : detect(wall_image(5), least)) EXPECT_GE(length(line), least);
  EXPECT_GT(detect(wall_image(5), 20).size(), detect(wall_image(5), 60).size());
}

// Share of `lines` that one of `others` covers for at least half, within 2 px at both ends.
double covered(const std::vector<Line>& lines, const std::vector<Line>& others) {
  const auto covers = [](const Line& o, const Line& l) {
    const float n = length(o);
    const float ux = (o.end_x_px - o.start_x_px) / n;
    const float uy = (o.end_y_px - o.start_y_px) / n;
    float from = 0;
    float to = 0;
    for (const auto& [x, y, at] :
         {std::tuple{l.start_x_px, l.start_y_px, &from}, {l.end_x_px, l.end_y_px, &to}}) {
      const float dx = x - o.start_x_px;
      const float dy = y - o.start_y_px;
      if (std::abs(dx * uy - dy * ux) > 2) return false;
      *at = std::clamp(dx * ux + dy * uy, 0.F, n);
    }
    return std::abs(to - from) >= 0.5F * length(l);
  };
  double count = 0;
  for (const Line& l : lines)
    count += std::any_of(others.begin(), others.end(), [&](const Line& o) { return covers(o, l); });
  return count / static_cast<double>(lines.size());
}

TEST(SegmentDetector, FindsWhatLsdFinds) {
  const auto lsd = cv::createLineSegmentDetector(cv::LSD_REFINE_STD, 0.8);
  for (unsigned seed = 1; seed <= 5; ++seed) {
    Image image = testing::with_noise(wall_image(seed), 3, seed);
    std::vector<cv::Vec4f> segments;
    lsd->detect(cv::Mat(image.height_px, image.width_px, CV_8UC1, image.pixels.data()), segments);
    std::vector<Line> reference;
    for (const cv::Vec4f& s : segments)
      if (const Line line{s[0], s[1], s[2], s[3]}; length(line) >= 20) reference.push_back(line);
    const auto ours = detect(image, 8);
    ASSERT_GT(reference.size(), 50U);
    EXPECT_GT(covered(reference, ours), 0.9) << seed;
    std::vector<Line> long_ones;
    std::copy_if(ours.begin(), ours.end(), std::back_inserter(long_ones),
                 [](const Line& l) { return length(l) >= 20; });
    std::vector<Line> all_reference;
    for (const cv::Vec4f& s : segments) all_reference.push_back({s[0], s[1], s[2], s[3]});
    EXPECT_GT(covered(long_ones, all_reference), 0.8) << seed;
  }
}

Image noise_image(int width, int height) {
  std::mt19937 random(7);
  Image image(width, height);
  for (auto& pixel : image.pixels) pixel = static_cast<std::uint8_t>(random());
  return image;
}

Image checkerboard(int side, int square) {
  Image image(side, side);
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) image.at(x, y) = (x / square + y / square) % 2 != 0 ? 255 : 0;
  return image;
}

TEST(SegmentDetector, AnswersAnything) {
  std::vector<Image> images = {Image(1, 1),        Image(1, 200, 9),  Image(200, 1, 9),
                               Image(4, 4, 9),     Image(64, 64, 77), noise_image(300, 200),
                               noise_image(6, 900)};
  for (const int square : {1, 2, 3, 7, 30}) images.push_back(checkerboard(200, square));
  GradientImage gradient;
  SegmentDetector kept;  // its memory is that of all images before
  std::vector<Line> lines;
  for (const Image& image : images) {
    gradient.compute(image.view());
    kept.detect(gradient, 6, lines);
    EXPECT_LE(lines.size(), image.pixels.size() / 6);
    for (const Line& line : lines)
      for (const auto& [at, side] : {std::pair{line.start_x_px, image.width_px},
                                     {line.end_x_px, image.width_px},
                                     {line.start_y_px, image.height_px},
                                     {line.end_y_px, image.height_px}}) {
        EXPECT_GE(at, -1);
        EXPECT_LE(at, static_cast<float>(side));
      }
    const auto again = detect(image, 6);
    ASSERT_EQ(again.size(), lines.size());
    for (std::size_t i = 0; i < lines.size(); ++i) {
      EXPECT_EQ(lines[i].start_x_px, again[i].start_x_px);
      EXPECT_EQ(lines[i].end_y_px, again[i].end_y_px);
    }
  }
}

}  // namespace
}  // namespace loopd
