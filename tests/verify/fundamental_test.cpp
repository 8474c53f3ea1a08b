#include "verify/fundamental.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>
#include <vector>

#include "verify/homography.h"
#include "verify/scene.h"

namespace loopd {
namespace {

using testing::make_scene;
using testing::Scene;
using testing::SceneOptions;

// The true partners of a scene as matches, so that the matchers have no say here.
Correspondences correspondences_of(const Scene& scene, double tolerance_px = 2) {
  std::vector<FeatureMatch> points;
  for (std::size_t i = 0; i < scene.query.points.size(); ++i)
    points.push_back({static_cast<std::uint32_t>(i),
                      static_cast<std::uint32_t>(scene.point_partner[i]), 20, 0.3});
  std::vector<LineMatch> lines;
  for (std::size_t i = 0; i < scene.query.lines.size(); ++i) {
    LineMatch match;
    match.query = static_cast<std::uint32_t>(i);
    match.candidate = static_cast<std::uint32_t>(scene.line_partner[i]);
    lines.push_back(match);
  }
  Correspondences c;
  make_correspondences(scene.query, scene.match, points, lines, {}, tolerance_px, c);
  return c;
}

double difference(const Mat3& a, const Mat3& b) {
  double same = 0, opposite = 0;
  for (std::size_t i = 0; i < 9; ++i) {
    same += (a[i] - b[i]) * (a[i] - b[i]);
    opposite += (a[i] + b[i]) * (a[i] + b[i]);
  }
  return std::sqrt(std::min(same, opposite));
}

TEST(SevenPoint, OneSolutionIsTheTruth) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    SceneOptions options;
    options.points = 30;
    options.lines = 0;
    options.noise_px = 0;
    options.seed = seed;
    const Scene scene = make_scene(options);
    const Correspondences c = correspondences_of(scene);
    std::array<std::uint32_t, 7> sample{};
    std::iota(sample.begin(), sample.end(), 0u);
    std::array<Mat3, 3> found{};
    const std::size_t count = seven_point(c, sample, found);
    ASSERT_GE(count, 1u);
    double nearest = 2;
    for (std::size_t m = 0; m < count; ++m) {
      EXPECT_NEAR(determinant(found[m]), 0, 1e-10);
      nearest =
          std::min(nearest, difference(fundamental_in_pixels(found[m], c), scene.fundamental));
    }
    EXPECT_LT(nearest, 1e-3) << "seed " << seed;  // positions are floats: 3e-5 px
  }
}

TEST(SevenPoint, RepeatedCorrespondencesAreRefused) {
  SceneOptions options;
  options.lines = 0;
  const Correspondences c = correspondences_of(make_scene(options));
  const std::array<std::uint32_t, 7> sample{0, 1, 2, 3, 4, 5, 5};
  std::array<Mat3, 3> found{};
  EXPECT_EQ(seven_point(c, sample, found), 0u);
}

TEST(EpipolarEstimator, ResidualIsTheSampsonDistanceOverTheTolerance) {
  SceneOptions options;
  options.noise_px = 0;
  options.outliers = 0.5;
  const Scene scene = make_scene(options);
  const Correspondences c = correspondences_of(scene, 2);
  std::array<std::uint32_t, 7> sample{};
  std::size_t filled = 0;
  for (std::uint32_t i = 0; filled < 7; ++i)
    if (scene.point_true[i]) sample[filled++] = i;
  std::array<EpipolarModel, 3> models{};
  const std::size_t count = EpipolarEstimator::solve(c, sample, models);
  ASSERT_GE(count, 1u);
  std::vector<double> residuals(c.size());
  for (std::size_t m = 0; m < count; ++m) {
    EpipolarEstimator::residuals(models[m], c, 0, c.size(), residuals);
    const Mat3 f = fundamental_in_pixels(models[m].fundamental, c);
    for (std::size_t i = 0; i < c.points; ++i) {
      if (residuals[i] > 1e9) continue;  // the wrong side
      const Point &q = scene.query.points[i], &p = scene.match.points[scene.point_partner[i]];
      const double to_match = testing::epipolar_distance(f, q.x_px, q.y_px, p.x_px, p.y_px);
      const double to_query =
          testing::epipolar_distance(transpose(f), p.x_px, p.y_px, q.x_px, q.y_px);
      if (to_match < 1e-3) continue;
      const double sampson_sq = 1 / (1 / (to_match * to_match) + 1 / (to_query * to_query));
      EXPECT_NEAR(residuals[i] / (sampson_sq / 4), 1, 1e-6);
    }
  }
}

TEST(EpipolarEstimator, AWorldBehindTheCameraIsOnTheWrongSide) {
  SceneOptions options;
  options.noise_px = 0;
  options.lines = 0;
  const Scene scene = make_scene(options);
  const Correspondences c = correspondences_of(scene);
  Random random(1);
  RansacScratch scratch;
  const auto found = estimate_fundamental(c, nullptr, 500, random, scratch);
  ASSERT_TRUE(found.has_value());
  EpipolarModel turned = found->model;
  for (double& x : turned.epipole) x = -x;
  std::vector<double> residuals(c.size());
  EpipolarEstimator::residuals(turned, c, 0, c.size(), residuals);
  EXPECT_EQ(support(c, residuals).features(), 0u);
}

TEST(EstimateFundamental, ADominantPlaneDoesNotMislead) {
  // Nine tenths of the points on a wall: most samples lie on it and leave F open.
  SceneOptions wall;
  wall.planar = true;
  wall.points = 360;
  wall.lines = 0;
  SceneOptions rest;
  rest.points = 40;
  rest.lines = 0;
  rest.seed = 2;
  Scene scene = make_scene(wall);
  const Scene other = make_scene(rest);
  for (std::size_t i = 0; i < other.query.points.size(); ++i) {
    scene.point_partner.push_back(scene.match.points.size() + other.point_partner[i]);
    scene.query.points.push_back(other.query.points[i]);
  }
  scene.match.points.insert(scene.match.points.end(), other.match.points.begin(),
                            other.match.points.end());
  const Correspondences c = correspondences_of(scene);
  Random random(3);
  RansacScratch scratch;
  const auto plane = estimate_homography(c, 500, random, scratch);
  ASSERT_TRUE(plane.has_value());
  const auto found = estimate_fundamental(c, &plane->model, 500, random, scratch);
  ASSERT_TRUE(found.has_value());
  std::vector<double> residuals(c.size());
  EpipolarEstimator::residuals(found->model, c, 0, c.size(), residuals);
  EXPECT_GE(support(c, residuals).features(), 390u);
}

TEST(EstimateFundamental, TooFewOrCoincidingAreNone) {
  Random random(1);
  RansacScratch scratch;
  SceneOptions options;
  options.points = 7;
  options.lines = 0;
  const Correspondences seven = correspondences_of(make_scene(options));
  EXPECT_FALSE(estimate_fundamental(seven, nullptr, 100, random, scratch).has_value());
  EXPECT_FALSE(estimate_fundamental({}, nullptr, 100, random, scratch).has_value());
  EXPECT_FALSE(estimate_homography({}, 100, random, scratch).has_value());
}

TEST(EstimateHomography, FindsTheTruth) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SceneOptions options;
    options.planar = true;
    options.noise_px = 0;
    options.lines = 0;
    options.outliers = 0.5;
    options.seed = seed;
    const Scene scene = make_scene(options);
    const Correspondences c = correspondences_of(scene);
    Random random(seed);
    RansacScratch scratch;
    const auto found = estimate_homography(c, 1000, random, scratch);
    ASSERT_TRUE(found.has_value());
    EXPECT_LT(difference(homography_in_pixels(found->model.forward, c), scene.homography), 1e-4);
  }
}

TEST(HomographyEstimator, RefusesCollinearAndMirroredSamples) {
  Correspondences c;
  c.points = 4;
  c.query_x = {0, 1, 2, 0};
  c.query_y = {0, 1, 2, 1};
  c.match_x = {0, 1, 2, 0.5};
  c.match_y = {0, 1, 2, 1};
  c.inverse_tolerance_sq.assign(4, 1);
  const std::array<std::uint32_t, 4> sample{0, 1, 2, 3};
  std::array<HomographyModel, 1> found{};
  EXPECT_EQ(HomographyEstimator::solve(c, sample, found), 0u);
  c.query_x = {0, 1, 1, 0};
  c.query_y = {0, 0, 1, 1};
  c.match_x = {0, -1, -1, 0};
  c.match_y = {0, 0, 1, 1};
  EXPECT_EQ(HomographyEstimator::solve(c, sample, found), 0u);
  c.match_x = {0, 1.5, 1.25, 0};
  EXPECT_EQ(HomographyEstimator::solve(c, sample, found), 1u);
}

TEST(Support, ALineCountsOnce) {
  Correspondences c;
  c.points = 2;
  c.lines = 3;
  const std::vector<double> residuals{0.5, 1.5, 0.2, 3, 3, 0.4, 1, 7};
  const Support s = support(c, residuals);
  EXPECT_EQ(s.points, 1u);
  EXPECT_EQ(s.lines, 2u);
  EXPECT_EQ(s.ends, 3u);
}

TEST(Sampler, DrawsDifferentEntriesAndMostlyPoints) {
  SceneOptions options;
  options.points = 100;
  options.lines = 50;
  const Correspondences c = correspondences_of(make_scene(options));
  const Sampler sampler(c);
  Random random(1);
  std::size_t points = 0, all = 0;
  for (int i = 0; i < 400; ++i) {
    std::array<std::uint32_t, 7> sample{};
    ASSERT_TRUE(sampler.draw(i, random, sample));
    EXPECT_EQ(std::set<std::uint32_t>(sample.begin(), sample.end()).size(), 7u);
    for (const std::uint32_t entry : sample) {
      EXPECT_LT(entry, c.size());
      points += entry < c.points;
      ++all;
    }
  }
  EXPECT_GT(points, all * 7 / 10);
  EXPECT_LT(points, all);
}

TEST(Sampler, FewerEntriesThanTheSampleIsFalse) {
  SceneOptions options;
  options.points = 6;
  options.lines = 0;
  const Correspondences c = correspondences_of(make_scene(options));
  Random random(1);
  std::array<std::uint32_t, 7> sample{};
  EXPECT_FALSE(Sampler(c).draw(0, random, sample));
}

}  // namespace
}  // namespace loopd
