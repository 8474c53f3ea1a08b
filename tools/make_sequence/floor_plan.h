#pragma once

#include <vector>

#include "make_sequence/geometry.h"
#include "make_sequence/random.h"

namespace loopd::sequence {

/// Corners of a closed rectilinear centre line, counter-clockwise, whose walk with corners rounded
/// at `radius_m` has length `loop_m`. Longer loops get bays that jut outwards, so no two legs that
/// are not neighbours come close.
std::vector<Vec3> make_floor_plan(double loop_m, double radius_m, Random& random);

/// A point of the walk and its direction.
struct WalkPoint {
  double x = 0;
  double y = 0;
  double heading_rad = 0;
};

/// The centre line with rounded corners, by arc length. Immutable after construction.
class Walk {
 public:
  Walk(const std::vector<Vec3>& corners, double radius_m);
  double length_m() const { return length_; }
  /// Where one is after `distance_m` >= 0 (any number of laps).
  WalkPoint at(double distance_m) const;

 private:
  struct Piece {
    double start_m;  ///< distance where it begins
    double x;
    double y;
    double heading_rad;
    double curvature;  ///< 0 straight, +-1 / radius in a corner, positive to the left
  };
  std::vector<Piece> pieces_;
  double length_ = 0;
};

}  // namespace loopd::sequence
