#include "verify/rotation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "verify/scene.h"

namespace loopd {
namespace {

using testing::uniform;

TEST(DeterministicAtan2, IsWithinAMilliardthOfTheLibrarys) {
  double worst = 0;
  Random random(1);
  for (int i = 0; i < 200'000; ++i) {
    const double y = uniform(random, -1, 1), x = uniform(random, -1, 1);
    worst = std::max(worst, std::abs(deterministic_atan2(y, x) - std::atan2(y, x)));
  }
  for (const double y : {-1e30, -1.0, -1e-30, 0.0, 1e-30, 1.0, 1e30})
    for (const double x : {-1e30, -1.0, -1e-30, 1e-30, 1.0, 1e30})
      worst = std::max(worst, absolute_angle(deterministic_atan2(y, x) - std::atan2(y, x)));
  EXPECT_LT(worst, 1e-9);
  EXPECT_EQ(deterministic_atan2(0, 0), 0);
}

TEST(AbsoluteAngle, WrapsToHalfATurn) {
  EXPECT_NEAR(absolute_angle(-0.1), 0.1, 1e-15);
  EXPECT_NEAR(absolute_angle(2 * kPi - 0.1), 0.1, 1e-14);
  EXPECT_NEAR(absolute_angle(kPi + 0.2), kPi - 0.2, 1e-14);
  EXPECT_NEAR(absolute_angle(-5 * kPi), kPi, 1e-14);
}

TEST(LineDirection, NeedsALength) {
  EXPECT_NEAR(*line_direction_rad({0, 0, 10, 0}), 0, 1e-12);
  EXPECT_NEAR(*line_direction_rad({0, 0, 0, 10}), kPi / 2, 1e-12);
  EXPECT_NEAR(*line_direction_rad({0, 0, 0, -10}), 1.5 * kPi, 1e-12);
  EXPECT_FALSE(line_direction_rad({5, 5, 5, 5}).has_value());
  EXPECT_FALSE(line_direction_rad({5, 5, std::numeric_limits<float>::quiet_NaN(), 5}).has_value());
  EXPECT_FALSE(line_direction_rad({5, 5, std::numeric_limits<float>::infinity(), 5}).has_value());
}

Line line_at(double angle_rad, double length) {
  return {0, 0, static_cast<float>(length * std::cos(angle_rad)),
          static_cast<float>(length * std::sin(angle_rad))};
}

// Directions as in a room: many upright, fewer level, more bright edges on one side than the other.
std::vector<Line> room(double turned_rad, Random& random) {
  std::vector<Line> lines;
  const auto add = [&](int count, double angle) {
    for (int i = 0; i < count; ++i)
      lines.push_back(
          line_at(angle + turned_rad + uniform(random, -0.03, 0.03), uniform(random, 30, 120)));
  };
  add(40, kPi / 2);
  add(18, 1.5 * kPi);
  add(15, 0.1);
  add(10, kPi - 0.2);
  return lines;
}

TEST(RotationFromLines, EveryRollIsFound) {
  Random random(2);
  for (int degrees = 0; degrees < 360; degrees += 15) {
    const double truth = degrees * kPi / 180;
    const auto found = rotation_from_lines(room(0, random), room(truth, random));
    ASSERT_TRUE(found.has_value()) << degrees;
    EXPECT_LT(absolute_angle(*found - truth), 3 * kPi / 180) << degrees;
  }
}

TEST(RotationFromLines, SaysNothingWhereItCannotTell) {
  Random random(3);
  std::vector<Line> cross, round;
  for (int i = 0; i < 80; ++i) {
    cross.push_back(line_at(i % 4 * kPi / 2 + uniform(random, -0.02, 0.02), 50));
    round.push_back(line_at(uniform(random, 0, 2 * kPi), 50));
  }
  EXPECT_FALSE(rotation_from_lines(cross, cross).has_value());
  EXPECT_FALSE(rotation_from_lines(cross, round).has_value());
  EXPECT_FALSE(rotation_from_lines({}, cross).has_value());
  EXPECT_FALSE(rotation_from_lines(cross, {}).has_value());
  const std::vector<Line> dots(5, Line{3, 3, 3, 3});
  EXPECT_FALSE(rotation_from_lines(dots, dots).has_value());
}

TEST(RotationFromPoints, OutvotesWrongMatches) {
  Random random(4);
  std::vector<Point> query, candidate;
  std::vector<FeatureMatch> matches;
  for (std::uint32_t i = 0; i < 200; ++i) {
    Point q = testing::point_at(0, 0), c = q;
    q.angle_deg = static_cast<float>(uniform(random, 0, 360));
    c.angle_deg =
        static_cast<float>(i % 5 < 3 ? uniform(random, 0, 360)
                                     : std::fmod(q.angle_deg + 137 + uniform(random, -8, 8), 360));
    query.push_back(q);
    candidate.push_back(c);
    matches.push_back({i, i, 20, 0.5});
  }
  const auto found = rotation_from_points(query, candidate, matches);
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR(*found, 137 * kPi / 180, 0.05);

  for (Point& c : candidate) c.angle_deg = static_cast<float>(uniform(random, 0, 360));
  EXPECT_FALSE(rotation_from_points(query, candidate, matches).has_value());
  matches.resize(7);
  EXPECT_FALSE(rotation_from_points(query, query, matches).has_value()) << "too few to say";
}

}  // namespace
}  // namespace loopd
