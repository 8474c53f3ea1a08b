#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "make_sequence/geometry.h"
#include "make_sequence/leg_style.h"
#include "make_sequence/picture.h"

namespace loopd::sequence {

/// A picture on a wall: u to the right as one looks at the wall, z up, metres.
struct Decal {
  double u0 = 0;
  double u1 = 0;
  double z0 = 0;
  double z1 = 0;
  std::size_t picture = 0;  ///< index into Scene::pictures
  double opacity = 1;
  bool multiply = false;  ///< darkens the wall (marks) instead of covering it
  double tone = 0;        ///< added to the picture's grey
};

/// A full-height wall in the plane x = at (axis 0) or y = at (axis 1), facing +axis or -axis.
struct Wall {
  int axis = 0;
  double at = 0;
  double lo = 0;  ///< extent along the other axis
  double hi = 0;
  int facing = 1;
  double albedo = 185;
  std::size_t leg = 0;  ///< index into Scene::legs
  bool rail = false;    ///< a protective strip at hand height
  std::vector<Decal> decals;
  /// u of a point is u_sign() times its coordinate along the wall.
  double u_sign() const { return axis == 0 ? facing : -facing; }
  double u_lo() const { return u_sign() > 0 ? lo : -hi; }
  double u_hi() const { return u_sign() > 0 ? hi : -lo; }
};

/// An axis-parallel box: pillar, door frame, cabinet, duct.
struct Box {
  Vec3 lo;
  Vec3 hi;
  double albedo = 180;
  int picture = -1;  ///< drawn on the sides, stretched over each; -1 for none
};

/// A lamp in the ceiling.
struct Light {
  double x0 = 0;
  double x1 = 0;
  double y0 = 0;
  double y1 = 0;
  double level[2] = {1, 1};  ///< 0 off, 1 full; on even laps and on odd laps
};

/// Values on a regular grid over the floor plan, read with bilinear interpolation.
class FloorGrid {
 public:
  FloorGrid() = default;
  FloorGrid(double x0, double y0, double x1, double y1, double cell_m);
  int columns() const { return columns_; }
  int rows() const { return rows_; }
  double x_of(int column) const { return x0_ + column * cell_; }
  double y_of(int row) const { return y0_ + row * cell_; }
  float& at(int column, int row);
  double read(double x, double y) const;

 private:
  double x0_ = 0;
  double y0_ = 0;
  double cell_ = 1;
  int columns_ = 0;
  int rows_ = 0;
  std::vector<float> values_;
};

struct SceneOptions {
  double loop_m = 60;       ///< length of the walk once round, >= kMinLoopM
  double texture = 1;       ///< 0..1: how much point-like texture there is; structure lines stay.
                            ///< Below 0.5 tiles and ceiling panels fade too (crossings are points)
  bool lap_change = false;  ///< some lamps differ on odd laps
  std::uint64_t seed = 1;
  double sameness = 0.3;  ///< 0..1: 1 makes every leg an exact copy in its dimensions
};
inline constexpr double kMinLoopM = 24;
inline constexpr double kMaxLoopM = 2000;

/// A closed loop of office corridors: walls, boxes, lamps, and the way round. Immutable once built.
struct Scene {
  double width_m = 2.2;
  double height_m = 2.6;
  double corner_radius_m = 1.0;  ///< of the walk
  double grain = 0;              ///< 0..1, strength of the fine wall texture
  double seams = 1;              ///< 0..1, contrast of floor tiles and ceiling panels
  std::vector<Vec3> corners;     ///< of the centre line, counter-clockwise
  std::vector<LegStyle> legs;    ///< leg i runs from corner i to the next
  LegMap leg_map;
  std::vector<Wall> walls;
  std::vector<Box> boxes;
  std::vector<Light> lights;
  std::vector<Picture> pictures;
  FloorGrid light_maps[2];  ///< lamp light over the floor plan, even and odd laps
};

/// Builds the corridor of `options` (within their ranges); the same options give the same scene.
Scene build_scene(const SceneOptions& options);

}  // namespace loopd::sequence
