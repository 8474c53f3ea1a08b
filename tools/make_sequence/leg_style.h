#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "make_sequence/geometry.h"

namespace loopd::sequence {

/// Rectangular tiles in the plane of floor or ceiling; a seam lies at (x0_m, y0_m).
struct Tiling {
  double size_x_m = 0.6;
  double size_y_m = 0.6;
  double x0_m = 0;
  double y0_m = 0;
};

/// Which part of the common noise a leg's surfaces show, and how far it is stretched.
struct GrainStyle {
  double u0_m = 0;
  double v0_m = 0;
  double stretch_u = 1;
  double stretch_v = 1;
};

/// The dimensions and tones that all bays of one leg share. The values given here are those of a
/// building whose legs are exact copies. Lengths are metres, tones are added to grey levels.
struct LegStyle {
  double bay_m = 3.6;      ///< pillar to pillar
  double bay_shift = 0;    ///< -0.5..0.5 of what is left of a wall after whole bays
  double pillar_m = 0.36;  ///< width
  double pillar_depth_m = 0.12;
  double pillar_tone = 0;
  double lamp_pitch_m = 2.7;
  double lamp_half_along_m = 0.6;
  double lamp_half_across_m = 0.15;
  double lamp_shift_m = 0;  ///< along the leg
  double lamp_aside_m = 0;  ///< to the left of the centre line
  double skirting_m = 0.1;  ///< height
  double skirting_tone = 0;
  double rail_z_m = 0.88;  ///< lower edge
  double rail_m = 0.12;    ///< height
  double rail_tone = 0;
  double door_width_m = 0.95;
  double door_height_m = 2.08;
  double door_tone = 0;
  double frame_bar_m = 0.07;
  double frame_depth_m = 0.035;
  double frame_tone = 0;
  double fitting_z_m = 0;  ///< how much higher plates, switches, boards and windows sit
  double wall_tone = 0;
  Tiling floor;
  Tiling ceiling;
  GrainStyle grain;
};

/// The style of leg `leg` of the building `seed`. `sameness` in [0, 1] draws every value towards
/// the common one: 1 gives LegStyle{} exactly.
LegStyle make_leg_style(std::uint64_t seed, std::size_t leg, double sameness);

/// Which leg a point of the floor plan belongs to: a leg owns its floor and the corner at its end.
/// Immutable after construction.
class LegMap {
 public:
  LegMap() = default;
  /// `corners` of the centre line; leg i runs from corner i to the next.
  LegMap(const std::vector<Vec3>& corners, double width_m);
  /// The leg at (x, y); outside the corridor one that is near, or leg 0.
  std::size_t leg_at(double x, double y) const;

 private:
  struct Area {
    double x0, y0, x1, y1;
  };
  void enter(std::size_t leg);
  std::vector<Area> areas_;  // a leg each
  std::vector<std::vector<std::size_t>> cells_;
  double x0_ = 0;
  double y0_ = 0;
  int columns_ = 0;
  int rows_ = 0;
};

}  // namespace loopd::sequence
