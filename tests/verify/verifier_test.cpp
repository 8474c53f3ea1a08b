#include "verify/verifier.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "verify/scene.h"

namespace loopd {
namespace {

using testing::make_scene;
using testing::Scene;
using testing::SceneOptions;

struct Outcome {
  Verification v;
  InlierPairs pairs;
};

Outcome verify(const Features& query, const Features& match, const VerifyConfig& config = {},
               std::uint64_t seed = 1) {
  Outcome out;
  out.v = Verifier(config).verify(query, match, seed, out.pairs);
  return out;
}

Outcome verify(const Scene& scene, const VerifyConfig& config = {}) {
  return verify(scene.query, scene.match, config);
}

// Of the inlier points, how many are true partners.
std::size_t true_point_inliers(const Scene& scene, const InlierPairs& pairs) {
  std::map<std::pair<float, float>, std::size_t> query_at;
  for (std::size_t i = 0; i < scene.query.points.size(); ++i)
    query_at[{scene.query.points[i].x_px, scene.query.points[i].y_px}] = i;
  std::size_t count = 0;
  for (const InlierPair& p : pairs) {
    if (p.is_line) continue;
    const std::size_t i = query_at.at({p.query_x_px, p.query_y_px});
    const Point& partner = scene.match.points[scene.point_partner[i]];
    count += scene.point_true[i] && partner.x_px == p.match_x_px && partner.y_px == p.match_y_px;
  }
  return count;
}

// Root mean square distance of the noise-free world from the epipolar lines of `f`, px.
double epipolar_error(const Verification& v, SceneOptions options) {
  options.noise_px = 0;
  options.outliers = 0;
  options.points = 300;
  options.lines = 0;
  options.seed += 1000;
  const Scene truth = make_scene(options);
  double sum = 0;
  for (std::size_t i = 0; i < truth.query.points.size(); ++i) {
    const Point &q = truth.query.points[i], &m = truth.match.points[truth.point_partner[i]];
    const double d = testing::epipolar_distance(v.fundamental, q.x_px, q.y_px, m.x_px, m.y_px);
    sum += d * d;
  }
  return std::sqrt(sum / static_cast<double>(truth.query.points.size()));
}

void expect_finite(const Verification& v) {
  for (const double x : v.fundamental) EXPECT_TRUE(std::isfinite(x));
  for (const double x : v.homography) EXPECT_TRUE(std::isfinite(x));
}

double norm_of(const std::array<double, 9>& m) {
  double sum = 0;
  for (const double x : m) sum += x * x;
  return std::sqrt(sum);
}

class VerifierOutliers : public ::testing::TestWithParam<int> {};

TEST_P(VerifierOutliers, FindsTheInliersAndTheGeometry) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SceneOptions options;
    options.outliers = GetParam() / 100.0;
    options.seed = seed;
    const Scene scene = make_scene(options);
    const auto [v, pairs] = verify(scene);
    EXPECT_EQ(v.model, Model::kFundamental);
    EXPECT_GE(static_cast<double>(true_point_inliers(scene, pairs)),
              0.9 * static_cast<double>(scene.true_points()));
    EXPECT_GE(static_cast<double>(v.line_inliers), 0.9 * static_cast<double>(scene.true_lines()));
    EXPECT_LT(epipolar_error(v, options), 1.5) << "seed " << seed;
    EXPECT_NEAR(norm_of(v.fundamental), 1, 1e-12);
    EXPECT_NEAR(determinant(v.fundamental), 0, 1e-12);
  }
}

INSTANTIATE_TEST_SUITE_P(Percent, VerifierOutliers, ::testing::Values(0, 20, 40, 60, 70));

TEST(Verifier, ReportsWhatItCounts) {
  SceneOptions options;
  options.outliers = 0.3;
  const Scene scene = make_scene(options);
  const auto [v, pairs] = verify(scene);
  std::size_t points = 0, ends = 0;
  bool line_seen = false;
  for (const InlierPair& p : pairs) {
    (p.is_line ? ends : points) += 1;
    EXPECT_FALSE(line_seen && !p.is_line) << "points come first";
    line_seen |= p.is_line;
  }
  EXPECT_EQ(points, static_cast<std::size_t>(v.agreeing - v.line_inliers));
  EXPECT_LE(static_cast<std::size_t>(v.point_inliers), points);
  EXPECT_GE(ends, static_cast<std::size_t>(v.line_inliers));
  EXPECT_LE(ends, 2 * static_cast<std::size_t>(v.line_inliers));
  EXPECT_LE(v.point_inliers, v.point_matches);
  EXPECT_LE(v.line_inliers, v.line_matches);
  EXPECT_GE(v.cells, 40);
  EXPECT_LE(v.cells, 48);
}

TEST(Verifier, PlaneIsAHomography) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SceneOptions options;
    options.planar = true;
    options.outliers = 0.3;
    options.seed = seed;
    options.translation = {1.5, 0.2, 0.5};
    const Scene scene = make_scene(options);
    const auto [v, pairs] = verify(scene);
    EXPECT_EQ(v.model, Model::kHomography) << "seed " << seed;
    EXPECT_GE(static_cast<double>(true_point_inliers(scene, pairs)),
              0.9 * static_cast<double>(scene.true_points()));
    EXPECT_EQ(v.homography_inliers, v.agreeing);
    const double sign = v.homography[8] * scene.homography[8] > 0 ? 1 : -1;
    // The entries differ by orders of magnitude in pixels: compare what they do to the corners.
    for (const double x : {0.0, 639.0})
      for (const double y : {0.0, 479.0}) {
        const Vec3 a = multiply(v.homography, Vec3{x, y, 1});
        const Vec3 b = multiply(scene.homography, Vec3{x, y, 1});
        EXPECT_GT(sign * a[2] * b[2], 0);
        EXPECT_NEAR(a[0] / a[2], b[0] / b[2], 3);
        EXPECT_NEAR(a[1] / a[2], b[1] / b[2], 3);
      }
  }
}

TEST(Verifier, PureRotationIsTold) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SceneOptions options;
    options.translation = {0, 0, 0};
    options.yaw_rad = 0.3;
    options.pitch_rad = -0.1;
    options.outliers = 0.2;
    options.seed = seed;
    const auto [v, pairs] = verify(make_scene(options));
    EXPECT_EQ(v.model, Model::kRotation) << "seed " << seed;
  }
}

TEST(Verifier, NeverClaimsARotationForAWall) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SceneOptions options;
    options.planar = true;
    options.seed = seed;
    const double step = 0.2 * static_cast<double>(seed);
    options.translation = {step, 0.1, seed % 2 == 0 ? 0.5 : 0.0};
    options.yaw_rad = seed % 3 == 0 ? 0.0 : 0.15;
    options.noise_px = seed % 4 == 0 ? 1.0 : 0.5;
    EXPECT_NE(verify(make_scene(options)).v.model, Model::kRotation) << "seed " << seed;
  }
}

TEST(Verifier, StandingStillIsNotClaimedARotation) {
  SceneOptions options;
  options.translation = {0, 0, 0};
  options.yaw_rad = options.pitch_rad = 0;
  const auto [v, pairs] = verify(make_scene(options));
  EXPECT_EQ(v.model, Model::kHomography);
  EXPECT_GE(v.point_inliers, 360);
}

TEST(Verifier, LinesAlone) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SceneOptions options;
    options.points = 0;
    options.lines = 120;
    options.outliers = 0.2;
    options.slide = 0.05;
    options.seed = seed;
    const Scene scene = make_scene(options);
    const auto [v, pairs] = verify(scene);
    EXPECT_EQ(v.point_inliers, 0);
    EXPECT_GE(static_cast<double>(v.line_inliers), 0.8 * static_cast<double>(scene.true_lines()));
  }
}

TEST(Verifier, UpsideDown) {
  for (const double points : {0, 300}) {
    SceneOptions options;
    options.points = static_cast<int>(points);
    options.lines = 120;
    options.roll_rad = std::acos(-1.0);
    options.slide = 0.05;
    const Scene scene = make_scene(options);
    const auto [v, pairs] = verify(scene);
    EXPECT_GE(v.line_matches, 110);
    EXPECT_GE(v.line_inliers, 100);
  }
}

TEST(Verifier, NothingToSee) {
  const Features empty;
  const Features some = testing::random_features(50, 10, 3);
  for (const auto& [q, m] : {std::pair{empty, empty}, {some, empty}, {empty, some}}) {
    const auto [v, pairs] = verify(q, m);
    EXPECT_EQ(v.matches(), 0);
    EXPECT_EQ(v.inliers(), 0);
    EXPECT_EQ(v.cells, 0);
    EXPECT_EQ(norm_of(v.fundamental), 0);
    EXPECT_TRUE(pairs.empty());
  }
}

TEST(Verifier, AFewMatches) {
  for (int points = 1; points <= 9; ++points) {
    SceneOptions options;
    options.points = points;
    options.lines = 0;
    const auto [v, pairs] = verify(make_scene(options));
    expect_finite(v);
    EXPECT_LE(v.inliers(), points);
    EXPECT_EQ(static_cast<int>(pairs.size()), v.inliers());
    if (points < 6) {
      EXPECT_EQ(v.inliers(), 0) << "any few correspondences have a model";
    }
  }
}

TEST(Verifier, SixMatchesOfAPlane) {
  SceneOptions options;
  options.points = 6;
  options.lines = 0;
  options.planar = true;
  options.noise_px = 0.1;
  const auto [v, pairs] = verify(make_scene(options));
  EXPECT_EQ(v.point_matches, 6);
  EXPECT_EQ(v.point_inliers, 6);
  EXPECT_EQ(v.model, Model::kHomography);
  EXPECT_EQ(norm_of(v.fundamental), 0) << "six points have no F";
}

// Degenerate positions: nothing but finite answers, and no more inliers than there are matches.
void expect_sane(const Scene& scene) {
  const auto [v, pairs] = verify(scene);
  expect_finite(v);
  EXPECT_LE(v.inliers(), v.matches());
  EXPECT_LE(pairs.size(), scene.query.points.size() + 2 * scene.query.lines.size());
}

TEST(Verifier, AllPointsInOnePlace) {
  Scene scene = make_scene({});
  for (Features* f : {&scene.query, &scene.match}) {
    for (Point& p : f->points) p.x_px = p.y_px = 100;
    for (Line& line : f->lines) line = {100, 100, 100, 100};
  }
  expect_sane(scene);
  EXPECT_EQ(verify(scene).v.inliers(), 0);
}

TEST(Verifier, AllPointsOfOneImageInOnePlace) {
  Scene scene = make_scene({});
  for (Point& p : scene.query.points) p.x_px = p.y_px = 100;
  expect_sane(scene);
}

TEST(Verifier, AllPointsOnOneLine) {
  SceneOptions options;
  options.lines = 0;
  Scene scene = make_scene(options);
  for (Point& p : scene.query.points) p.y_px = 0.5F * p.x_px;
  for (std::size_t i = 0; i < scene.query.points.size(); ++i) {
    Point& m = scene.match.points[scene.point_partner[i]];
    m.x_px = scene.query.points[i].x_px + 20;
    m.y_px = scene.query.points[i].y_px + 5;
  }
  expect_sane(scene);
}

TEST(Verifier, PositionsThatAreNoNumbersAreLeftOut) {
  Scene scene = make_scene({});
  const float bad[] = {std::numeric_limits<float>::quiet_NaN(),
                       std::numeric_limits<float>::infinity(),
                       -std::numeric_limits<float>::infinity()};
  for (std::size_t i = 0; i < 90; ++i) scene.query.points[i].x_px = bad[i % 3];
  for (std::size_t i = 90; i < 120; ++i) scene.query.points[i].angle_deg = bad[i % 3];
  for (std::size_t i = 120; i < 130; ++i) scene.query.points[i].size_px = bad[i % 3];
  for (std::size_t i = 0; i < 20; ++i) scene.match.lines[i].end_y_px = bad[i % 3];
  const auto [v, pairs] = verify(scene);
  expect_finite(v);
  EXPECT_GE(v.agreeing - v.line_inliers, 270);
  EXPECT_LE(v.agreeing - v.line_inliers, 300);
  EXPECT_LE(v.line_inliers, 40);
  for (const InlierPair& p : pairs)
    EXPECT_TRUE(std::isfinite(p.query_x_px + p.query_y_px + p.match_x_px + p.match_y_px));
}

TEST(Verifier, HugeCoordinates) {
  Scene scene = make_scene({});
  for (Point& p : scene.query.points) p.x_px *= 1e30F;
  expect_sane(scene);
}

TEST(Verifier, MorePairsThanTheReportHolds) {
  SceneOptions options;
  options.points = 5000;
  options.lines = 0;
  const Scene scene = make_scene(options);
  const auto [v, pairs] = verify(scene);
  EXPECT_TRUE(pairs.full());
  EXPECT_GE(v.agreeing, 4500);
}

// One corner answers on several pyramid levels: the same evidence, however many points it gives.
TEST(Verifier, CountsAPlaceOnce) {
  SceneOptions options;
  options.lines = 0;
  Scene scene = make_scene(options);
  const auto [once, pairs] = verify(scene);
  const std::size_t points = scene.query.points.size();
  for (std::size_t i = 0; i < points; ++i) {
    for (Features* f : {&scene.query, &scene.match}) {
      f->points.push_back(f->points[i]);
      Descriptor other = f->point_descriptors[i];
      for (std::uint64_t& word : other.words) word = ~word;  // matches its own twin only
      f->point_descriptors.push_back(other);
    }
  }
  const auto [twice, twice_pairs] = verify(scene);
  EXPECT_GE(twice.agreeing, 19 * once.agreeing / 10);
  EXPECT_LE(twice.point_inliers, 11 * once.point_inliers / 10);
}

TEST(Verifier, SameSeedSameBits) {
  SceneOptions options;
  options.outliers = 0.6;
  const Scene scene = make_scene(options);
  Verifier used({});
  InlierPairs a, b;
  (void)used.verify(testing::random_features(300, 40, 9), scene.match, 5, a);
  const Verification first = used.verify(scene.query, scene.match, 7, a);
  const Verification second = Verifier({}).verify(scene.query, scene.match, 7, b);
  EXPECT_EQ(std::memcmp(first.fundamental.data(), second.fundamental.data(), 72), 0);
  EXPECT_EQ(std::memcmp(first.homography.data(), second.homography.data(), 72), 0);
  EXPECT_EQ(first.inliers(), second.inliers());
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].query_x_px, b[i].query_x_px);
}

TEST(Verifier, UnrelatedDescriptorsDoNotMatch) {
  const auto [v, pairs] =
      verify(testing::random_features(800, 150, 1), testing::random_features(800, 150, 2));
  EXPECT_EQ(v.matches(), 0);
}

// The floor of false positives: every match is wrong, at random positions.
TEST(Verifier, WrongMatchesHaveFewInliers) {
  int most = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SceneOptions options;
    options.points = 100;
    options.lines = 30;
    options.outliers = 1;
    options.seed = seed;
    const auto [v, pairs] = verify(make_scene(options));
    EXPECT_GE(v.matches(), 110);
    most = std::max(most, v.inliers());
  }
  RecordProperty("most_inliers", most);
  EXPECT_LE(most, 20) << "of 130 wrong matches; 16 when this was written";
}

TEST(Verifier, TheAngleFilterCanBeTurnedOff) {
  VerifyConfig plain;
  plain.line_angle_filter = false;
  const Scene scene = make_scene({});
  EXPECT_GE(verify(scene, plain).v.line_inliers, 50);
}

}  // namespace
}  // namespace loopd
