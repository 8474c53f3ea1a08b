#include "features/orb_descriptor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>
#include <tuple>

#include "base/hamming.h"
#include "features/orb_pattern.h"
#include "support/scene_image.h"

namespace loopd {
namespace {

using testing::Image;
using testing::wall_image;
using testing::with_noise;

constexpr double kPi = 3.14159265358979323846;

IntensityMoments reference_moments(const Image& image, int x, int y) {
  IntensityMoments moments;
  for (int dy = -15; dy <= 15; ++dy)
    for (int dx = -15; dx <= 15; ++dx) {
      if (dx * dx + dy * dy > 15 * 16) continue;
      moments.x += dx * image.at(x + dx, y + dy);
      moments.y += dy * image.at(x + dx, y + dy);
    }
  return moments;
}

TEST(IntensityMoments, AreTheSumsOverTheDiscInEveryForm) {
  const Image images[] = {with_noise(wall_image(1, 0, 90, 70), 30, 1), Image(90, 70, 255), [] {
                            Image half(90, 70);  // the largest sums that can be
                            half.fill(0, 35, 90, 70, 255);
                            return half;
                          }()};
  for (const SimdForm form : simd_forms())
    for (const Image& image : images)
      for (int y = 16; y < 54; y += 3)
        for (int x = 16; x < 74; x += 5)
          ASSERT_EQ(intensity_moments(form, image.view(), x, y), reference_moments(image, x, y));
}

TEST(Orientation, IsTheAngleOfTheCentroid) {
  EXPECT_EQ(orientation_deg({0, 0}), 0);
  EXPECT_EQ(orientation_deg({5, 0}), 0);
  EXPECT_FLOAT_EQ(orientation_deg({0, 5}), 90);  // below, on the screen
  EXPECT_FLOAT_EQ(orientation_deg({-5, 0}), 180);
  EXPECT_FLOAT_EQ(orientation_deg({0, -5}), 270);
  std::mt19937 random(1);
  for (int i = 0; i < 100000; ++i) {
    const int reach = 1 << (1 + i % 20);
    const auto draw = [&] {
      return static_cast<int>(random() % (2U * static_cast<unsigned>(reach))) - reach;
    };
    const IntensityMoments m{draw(), draw()};
    if (m.x == 0 && m.y == 0) continue;
    const float angle = orientation_deg(m);
    ASSERT_GE(angle, 0);
    ASSERT_LT(angle, 360);
    const double off = std::remainder(angle - std::atan2(m.y, m.x) * 180 / kPi, 360);
    ASSERT_NEAR(off, 0, 0.01) << m.x << ", " << m.y;
  }
  EXPECT_LT(orientation_deg({2'000'000'000, -1}), 360);
}

TEST(OrbPattern, Has256DifferentTestsInsideTheDisc) {
  std::set<std::tuple<int, int, int, int>> seen;
  for (const BinaryTest& t : kOrbPattern) {
    EXPECT_LE(t.ax * t.ax + t.ay * t.ay, 15 * 15);
    EXPECT_LE(t.bx * t.bx + t.by * t.by, 15 * 15);
    EXPECT_TRUE(t.ax != t.bx || t.ay != t.by);
    EXPECT_TRUE(seen.emplace(t.ax, t.ay, t.bx, t.by).second);
    EXPECT_FALSE(seen.contains({t.bx, t.by, t.ax, t.ay}));
  }
}

// Every test read off the image at its turned place.
Descriptor reference_descriptor(const Image& image, int x, int y, float angle_deg) {
  const double turn = std::floor(angle_deg / 5.625 + 0.5) * 5.625 * kPi / 180;
  const double c = std::cos(turn), s = std::sin(turn);
  const auto at = [&](int dx, int dy) {
    const int px = static_cast<int>(std::floor(c * dx - s * dy + 0.5 + 1e-12));
    const int py = static_cast<int>(std::floor(s * dx + c * dy + 0.5 + 1e-12));
    return image.at(x + px, y + py);
  };
  Descriptor d;
  for (std::size_t i = 0; i < 256; ++i) {
    const BinaryTest& t = kOrbPattern[i];
    if (at(t.ax, t.ay) < at(t.bx, t.by)) d.words[i / 64] |= std::uint64_t{1} << (i % 64);
  }
  return d;
}

TEST(OrbDescriber, AnswersEachTestAtItsTurnedPlace) {
  const Image image = with_noise(wall_image(8, 0, 120, 90), 40, 3);
  const OrbDescriber describer;
  std::mt19937 random(5);
  for (int i = 0; i < 500; ++i) {
    const int x = 16 + static_cast<int>(random() % 88U), y = 16 + static_cast<int>(random() % 58U);
    const auto angle = static_cast<float>(random() % 36000U) / 100;
    // On the exact half of a pixel the two sums may round apart: a bit or two.
    ASSERT_LE(hamming_distance(describer.describe(image.view(), x, y, angle),
                               reference_descriptor(image, x, y, angle)),
              2)
        << angle;
  }
}

TEST(OrbDescriber, TurnsWithTheImageByQuarters) {
  const Image image = with_noise(wall_image(8, 0, 90, 90), 20, 3);
  Image turned(90, 90);  // clockwise
  for (int y = 0; y < 90; ++y)
    for (int x = 0; x < 90; ++x) turned.at(89 - y, x) = image.at(x, y);
  const OrbDescriber describer;
  for (int y = 20; y < 70; y += 7)
    for (int x = 20; x < 70; x += 9) {
      const float a = orientation_deg(intensity_moments(SimdForm::kBaseline, image.view(), x, y));
      const float b =
          orientation_deg(intensity_moments(SimdForm::kBaseline, turned.view(), 89 - y, x));
      ASSERT_NEAR(std::remainder(b - a, 360), 90, 0.02);
      const int distance = hamming_distance(describer.describe(image.view(), x, y, a),
                                            describer.describe(turned.view(), 89 - y, x, b));
      ASSERT_LE(distance, 24);  // an angle at the seam of two turns may fall to either side
    }
}

TEST(OrbDescriber, TakesEveryAngle) {
  const Image image = wall_image(8, 0, 90, 90);
  const OrbDescriber describer;
  EXPECT_EQ(describer.describe(image.view(), 40, 40, 0),
            describer.describe(image.view(), 40, 40, 359.99F));
  EXPECT_EQ(describer.describe(Image(90, 90, 9).view(), 16, 16, 123), Descriptor{});
}

}  // namespace
}  // namespace loopd
