#include "make_sequence/leg_style.h"

#include <algorithm>
#include <cmath>

#include "make_sequence/random.h"

namespace loopd::sequence {
namespace {

constexpr double kCellM = 1;
constexpr double kGrainPeriodM = 2.56;

/// Draws values that keep the share `sameness` of their common value.
class Variation {
 public:
  Variation(std::uint64_t seed, double sameness) : random_(seed), sameness_(sameness) {}
  /// Between `lo` and `hi` for a sameness of 0, `common` for 1.
  void vary(double& common, double lo, double hi) {
    const double own = random_.uniform(lo, hi);
    common += (1 - sameness_) * (own - common);
  }

 private:
  Random random_;
  double sameness_;
};

void vary_tiles(Variation& v, Tiling& tiling, double lo, double hi) {
  v.vary(tiling.size_x_m, lo, hi);
  v.vary(tiling.size_y_m, lo, hi);
  v.vary(tiling.x0_m, 0, tiling.size_x_m);
  v.vary(tiling.y0_m, 0, tiling.size_y_m);
}

void vary_grain(Variation& v, GrainStyle& grain) {
  v.vary(grain.u0_m, 0, kGrainPeriodM);
  v.vary(grain.v0_m, 0, kGrainPeriodM);
  v.vary(grain.stretch_u, 0.6, 1.5);
  v.vary(grain.stretch_v, 0.6, 1.5);
}

void vary_walls(Variation& v, LegStyle& style) {
  v.vary(style.bay_m, 2.8, 4.6);
  v.vary(style.bay_shift, -0.45, 0.45);
  v.vary(style.pillar_m, 0.2, 0.6);
  v.vary(style.pillar_depth_m, 0.05, 0.2);
  v.vary(style.pillar_tone, -40, 15);
  v.vary(style.skirting_m, 0.05, 0.2);
  v.vary(style.skirting_tone, -40, 60);
  v.vary(style.rail_z_m, 0.7, 1.05);
  v.vary(style.rail_m, 0.06, 0.2);
  v.vary(style.rail_tone, -50, 30);
  v.vary(style.fitting_z_m, -0.15, 0.15);
  v.vary(style.wall_tone, -20, 10);
}

void vary_doors(Variation& v, LegStyle& style) {
  v.vary(style.door_width_m, 0.8, 1.05);
  v.vary(style.door_height_m, 1.95, 2.2);
  v.vary(style.door_tone, -45, 30);
  v.vary(style.frame_bar_m, 0.04, 0.11);
  v.vary(style.frame_depth_m, 0.01, 0.06);
  v.vary(style.frame_tone, -30, 20);
}

void vary_lamps(Variation& v, LegStyle& style) {
  v.vary(style.lamp_pitch_m, 2.0, 3.8);
  v.vary(style.lamp_half_along_m, 0.25, 0.75);
  v.vary(style.lamp_half_across_m, 0.08, 0.3);
  v.vary(style.lamp_shift_m, -0.25, 0.25);
  v.vary(style.lamp_aside_m, -0.45, 0.45);
}

}  // namespace

LegStyle make_leg_style(std::uint64_t seed, std::size_t leg, double sameness) {
  // A stream a leg and a group, so that a value more in one changes no other.
  const auto variation = [&](std::uint64_t group) {
    return Variation(mix64(seed ^ mix64(0x1e95ULL + 16 * leg + group)), sameness);
  };
  LegStyle style;
  Variation walls = variation(0);
  Variation doors = variation(1);
  Variation lamps = variation(2);
  Variation floor = variation(3);
  Variation ceiling = variation(4);
  Variation grain = variation(5);
  vary_walls(walls, style);
  vary_doors(doors, style);
  vary_lamps(lamps, style);
  vary_tiles(floor, style.floor, 0.4, 0.9);
  vary_tiles(ceiling, style.ceiling, 0.45, 1.2);
  vary_grain(grain, style.grain);
  return style;
}

LegMap::LegMap(const std::vector<Vec3>& corners, double width_m) {
  const std::size_t n = corners.size();
  const double half = width_m / 2;
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 leg = corners[(i + 1) % n] - corners[i];
    const Vec3 ahead = (1 / (std::abs(leg.x) + std::abs(leg.y))) * leg;
    const Vec3 left{-ahead.y, ahead.x, 0};
    const Vec3 a = corners[i] + half * (ahead + left);
    const Vec3 b = corners[(i + 1) % n] + half * (ahead - left);
    areas_.push_back(
        {std::min(a.x, b.x), std::min(a.y, b.y), std::max(a.x, b.x), std::max(a.y, b.y)});
  }
  x0_ = y0_ = 1e9;
  double x1 = -1e9;
  double y1 = -1e9;
  for (const Area& area : areas_) {
    x0_ = std::min(x0_, area.x0);
    y0_ = std::min(y0_, area.y0);
    x1 = std::max(x1, area.x1);
    y1 = std::max(y1, area.y1);
  }
  columns_ = static_cast<int>((x1 - x0_) / kCellM) + 1;
  rows_ = static_cast<int>((y1 - y0_) / kCellM) + 1;
  cells_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  for (std::size_t leg = 0; leg < areas_.size(); ++leg) enter(leg);
}

void LegMap::enter(std::size_t leg) {
  const Area& area = areas_[leg];
  const int c0 = static_cast<int>((area.x0 - x0_) / kCellM);
  const int r0 = static_cast<int>((area.y0 - y0_) / kCellM);
  const int c1 = static_cast<int>((area.x1 - x0_) / kCellM);
  const int r1 = static_cast<int>((area.y1 - y0_) / kCellM);
  for (int r = r0; r <= r1; ++r) {
    for (int c = c0; c <= c1; ++c)
      cells_[static_cast<std::size_t>(r * columns_ + c)].push_back(leg);
  }
}

std::size_t LegMap::leg_at(double x, double y) const {
  if (cells_.empty()) return 0;
  const int c = static_cast<int>(std::clamp((x - x0_) / kCellM, 0.0, columns_ - 1.0));
  const int r = static_cast<int>(std::clamp((y - y0_) / kCellM, 0.0, rows_ - 1.0));
  const std::vector<std::size_t>& cell = cells_[static_cast<std::size_t>(r * columns_ + c)];
  for (const std::size_t leg : cell) {
    const Area& area = areas_[leg];
    if (x >= area.x0 && x <= area.x1 && y >= area.y0 && y <= area.y1) return leg;
  }
  return cell.empty() ? 0 : cell.front();
}

}  // namespace loopd::sequence
