#include "make_sequence/floor_plan.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace loopd::sequence {
namespace {

constexpr double kSideForBayM = 30;  // a side this long gets a bay for each such length
constexpr double kBayDepthM = 7;
constexpr double kBayWidthM = 9;

double polygon_length(const std::vector<Vec3>& corners) {
  double length = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vec3 d = corners[(i + 1) % corners.size()] - corners[i];
    length += std::abs(d.x) + std::abs(d.y);
  }
  return length;
}

/// Appends the side from `from` to `to` (without `to`), with bays to its right.
void add_side(std::vector<Vec3>& corners, Vec3 from, Vec3 to, Random& random) {
  const double length = std::abs(to.x - from.x) + std::abs(to.y - from.y);
  const Vec3 ahead = (1 / length) * (to - from);
  const Vec3 outward{ahead.y, -ahead.x, 0};
  const int bays = static_cast<int>(length / kSideForBayM);
  corners.push_back(from);
  for (int i = 0; i < bays; ++i) {
    const double room = length / bays;
    const double width = kBayWidthM * random.uniform(1.0, 1.3);
    const double start = room * i + random.uniform(0.25, 0.4) * room;
    const double depth = kBayDepthM * random.uniform(0.9, 1.3);
    const Vec3 a = from + start * ahead;
    const Vec3 b = from + (start + width) * ahead;
    corners.insert(corners.end(), {a, a + depth * outward, b + depth * outward, b});
  }
}

/// How much shorter a walk is when `corners` right angles are rounded.
double rounding_saves(std::size_t corners, double radius) {
  return static_cast<double>(corners) * radius * (2 - std::numbers::pi / 2);
}

}  // namespace

std::vector<Vec3> make_floor_plan(double loop_m, double radius_m, Random& random) {
  // With the bays the perimeter grows; 0.75 keeps the rectangle in proportion before scaling.
  const double perimeter = loop_m < 4 * kSideForBayM ? loop_m : 0.75 * loop_m;
  const double longer = perimeter / 2 * random.uniform(0.56, 0.62);
  const double shorter = perimeter / 2 - longer;
  const Vec3 rectangle[4] = {{0, 0, 0}, {longer, 0, 0}, {longer, shorter, 0}, {0, shorter, 0}};
  std::vector<Vec3> corners;
  for (int i = 0; i < 4; ++i) add_side(corners, rectangle[i], rectangle[(i + 1) % 4], random);
  const double wanted = loop_m + rounding_saves(corners.size(), radius_m);
  const double scale = wanted / polygon_length(corners);
  for (Vec3& corner : corners) corner = scale * corner;
  return corners;
}

Walk::Walk(const std::vector<Vec3>& corners, double radius_m) {
  const std::size_t n = corners.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 leg = corners[(i + 1) % n] - corners[i];
    const Vec3 next = corners[(i + 2) % n] - corners[(i + 1) % n];
    const double leg_m = std::abs(leg.x) + std::abs(leg.y);
    const Vec3 ahead = (1 / leg_m) * leg;
    const double heading = std::atan2(leg.y, leg.x);
    const Vec3 start = corners[i] + radius_m * ahead;
    pieces_.push_back({length_, start.x, start.y, heading, 0});
    length_ += leg_m - 2 * radius_m;
    const Vec3 bend = corners[(i + 1) % n] - radius_m * ahead;
    const double turn = leg.x * next.y - leg.y * next.x > 0 ? 1 : -1;
    pieces_.push_back({length_, bend.x, bend.y, heading, turn / radius_m});
    length_ += radius_m * std::numbers::pi / 2;
  }
}

WalkPoint Walk::at(double distance_m) const {
  const double s = std::fmod(distance_m, length_);
  const auto after = std::upper_bound(pieces_.begin(), pieces_.end(), s,
                                      [](double v, const Piece& p) { return v < p.start_m; });
  const Piece& piece = *(after - 1);
  const double along = s - piece.start_m;
  const double c = std::cos(piece.heading_rad);
  const double q = std::sin(piece.heading_rad);
  if (piece.curvature == 0) return {piece.x + along * c, piece.y + along * q, piece.heading_rad};
  const double heading = piece.heading_rad + along * piece.curvature;
  return {piece.x + (std::sin(heading) - q) / piece.curvature,
          piece.y - (std::cos(heading) - c) / piece.curvature, heading};
}

}  // namespace loopd::sequence
