#include "verify/correspondences.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "verify/rotation.h"

namespace loopd {
namespace {

// Diameter of an ORB patch at the finest level of a full-resolution pyramid.
constexpr double kPatchPx = 31;
// Width up to which line segments are found at full resolution; beyond, on a reduced image.
constexpr double kFullResolutionPx = 1280;
constexpr double kMaxCoarseness = 16;
// Points whose orientations differ by more than this from the global rotation are trusted last.
constexpr double kAngleTrustRad = 25 * kPi / 180;

// A point of a level `coarseness` times coarser is located to a step of that many pixels. Errors
// that do not grow with it (calibration, matching) have 0.6 px, the step 0.3 px each sigma; the
// tolerance grows with their root sum of squares.
double tolerance_factor(double coarseness) {
  const double c = std::clamp(coarseness, 1.0, kMaxCoarseness);
  return std::sqrt(0.8 + 0.2 * c * c);
}

struct Place {
  double query_x, query_y, match_x, match_y;
  bool finite() const {
    return std::isfinite(query_x) && std::isfinite(query_y) && std::isfinite(match_x) &&
           std::isfinite(match_y);
  }
};

Place start_of(const Line& q, const Line& c, bool flipped) {
  return flipped ? Place{q.start_x_px, q.start_y_px, c.end_x_px, c.end_y_px}
                 : Place{q.start_x_px, q.start_y_px, c.start_x_px, c.start_y_px};
}

Place end_of(const Line& q, const Line& c, bool flipped) {
  return flipped ? Place{q.end_x_px, q.end_y_px, c.start_x_px, c.start_y_px}
                 : Place{q.end_x_px, q.end_y_px, c.end_x_px, c.end_y_px};
}

void append(const Place& place, double tolerance_px, Correspondences& out) {
  out.query_x.push_back(place.query_x);
  out.query_y.push_back(place.query_y);
  out.match_x.push_back(place.match_x);
  out.match_y.push_back(place.match_y);
  out.inverse_tolerance_sq.push_back(1 / (tolerance_px * tolerance_px));
}

void append_points(const Features& query, const Features& candidate,
                   std::span<const FeatureMatch> matches, double tolerance_px,
                   Correspondences& out) {
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Point& q = query.points[matches[i].query];
    const Point& c = candidate.points[matches[i].candidate];
    const Place place{q.x_px, q.y_px, c.x_px, c.y_px};
    const double size = std::max(q.size_px, c.size_px);
    if (!place.finite() || !std::isfinite(q.size_px) || !std::isfinite(c.size_px)) continue;
    append(place, tolerance_px * tolerance_factor(size / kPatchPx), out);
    out.point_match.push_back(static_cast<std::uint32_t>(i));
  }
  out.points = out.point_match.size();
}

void append_lines(const Features& query, const Features& candidate,
                  std::span<const LineMatch> matches, double tolerance_px, Correspondences& out) {
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const Line& q = query.lines[matches[i].query];
    const Line& c = candidate.lines[matches[i].candidate];
    if (!start_of(q, c, matches[i].flipped).finite()) continue;
    if (!end_of(q, c, matches[i].flipped).finite()) continue;
    out.line_match.push_back(static_cast<std::uint32_t>(i));
  }
  out.lines = out.line_match.size();
  for (const auto place_of : {start_of, end_of})
    for (const std::uint32_t i : out.line_match)
      append(place_of(query.lines[matches[i].query], candidate.lines[matches[i].candidate],
                      matches[i].flipped),
             tolerance_px, out);
}

// Centre of each image's positions at 0, root mean square distance from it (both images) sqrt(2).
void normalise(Correspondences& c) {
  if (c.size() == 0) return;
  const double n = static_cast<double>(c.size());
  const auto mean = [n](const std::vector<double>& column) {
    double sum = 0;
    for (const double x : column) sum += x;
    return sum / n;
  };
  c.query_centre_px = {mean(c.query_x), mean(c.query_y)};
  c.match_centre_px = {mean(c.match_x), mean(c.match_y)};
  double sum = 0;
  const auto centre = [&sum](std::vector<double>& column, double centre_px) {
    for (double& x : column) {
      x -= centre_px;
      sum += x * x;
    }
  };
  centre(c.query_x, c.query_centre_px[0]);
  centre(c.query_y, c.query_centre_px[1]);
  centre(c.match_x, c.match_centre_px[0]);
  centre(c.match_y, c.match_centre_px[1]);
  const double scale = std::sqrt(sum / (4 * n));
  if (!(scale > 1e-6) || !std::isfinite(scale)) return;  // all in one place
  c.scale_px = scale;
  for (auto* column : {&c.query_x, &c.query_y, &c.match_x, &c.match_y})
    for (double& x : *column) x /= scale;
  for (double& x : c.inverse_tolerance_sq) x *= scale * scale;
}

// The ratio; points that turned otherwise than most come after all others.
double point_distrust(const Point& query, const Point& candidate, double ratio,
                      std::optional<double> rotation_rad) {
  if (!rotation_rad) return ratio;
  const double q = query.angle_deg, c = candidate.angle_deg;
  if (!(q >= 0 && q <= 360 && c >= 0 && c <= 360)) return 1 + ratio;
  const double off = absolute_angle((q - c) * (kPi / 180) + *rotation_rad);
  return off <= kAngleTrustRad ? ratio : 1 + ratio;
}

void rank(const Features& query, const Features& candidate,
          std::span<const FeatureMatch> point_matches, std::span<const LineMatch> line_matches,
          std::optional<double> rotation_rad, Correspondences& out) {
  for (const std::uint32_t i : out.point_match) {
    const FeatureMatch& m = point_matches[i];
    out.distrust.push_back(point_distrust(query.points[m.query], candidate.points[m.candidate],
                                          m.ratio, rotation_rad));
  }
  for (int end = 0; end < 2; ++end)
    for (const std::uint32_t i : out.line_match) out.distrust.push_back(line_matches[i].ratio);
  const auto sort_entries = [&out](std::size_t first, std::size_t count,
                                   std::vector<std::uint32_t>& list) {
    list.resize(count);
    std::iota(list.begin(), list.end(), static_cast<std::uint32_t>(first));
    std::sort(list.begin(), list.end(), [&out](std::uint32_t a, std::uint32_t b) {
      return out.distrust[a] != out.distrust[b] ? out.distrust[a] < out.distrust[b] : a < b;
    });
  };
  sort_entries(0, out.points, out.trusted_points);
  sort_entries(out.points, 2 * out.lines, out.trusted_ends);
}

}  // namespace

void Correspondences::clear() {
  points = lines = 0;
  for (auto* column : {&query_x, &query_y, &match_x, &match_y, &inverse_tolerance_sq, &distrust})
    column->clear();
  for (auto* list : {&trusted_points, &trusted_ends, &point_match, &line_match}) list->clear();
  query_centre_px = match_centre_px = {};
  scale_px = 0;
}

void make_correspondences(const Features& query, const Features& candidate,
                          std::span<const FeatureMatch> point_matches,
                          std::span<const LineMatch> line_matches,
                          std::optional<double> rotation_rad, double tolerance_px,
                          Correspondences& out) {
  out.clear();
  const double longest =
      std::max({query.width_px, query.height_px, candidate.width_px, candidate.height_px});
  append_points(query, candidate, point_matches, tolerance_px, out);
  append_lines(query, candidate, line_matches,
               tolerance_px * tolerance_factor(longest / kFullResolutionPx), out);
  normalise(out);
  rank(query, candidate, point_matches, line_matches, rotation_rad, out);
}

Mat3 normalisation(const std::array<double, 2>& centre_px, double scale_px) {
  return {1 / scale_px,
          0,
          -centre_px[0] / scale_px,
          0,
          1 / scale_px,
          -centre_px[1] / scale_px,
          0,
          0,
          1};
}

Mat3 denormalisation(const std::array<double, 2>& centre_px, double scale_px) {
  return {scale_px, 0, centre_px[0], 0, scale_px, centre_px[1], 0, 0, 1};
}

}  // namespace loopd
