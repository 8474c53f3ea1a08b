#include "make_sequence/scene.h"

#include <algorithm>
#include <cmath>

#include "make_sequence/artwork.h"
#include "make_sequence/floor_plan.h"
#include "make_sequence/random.h"

namespace loopd::sequence {
namespace {

// Of the pictures drawn; on the wall they are stretched to the leg's doors.
constexpr double kDoorWidthM = 0.95;
constexpr double kDoorHeightM = 2.08;
constexpr int kDoorStyles = 4;

/// Furnishes the walls of a scene, one bay after the other.
class Builder {
 public:
  Builder(Scene& scene, const SceneOptions& options)
      : scene_(scene), random_(mix64(options.seed ^ 0x5ce7eULL)), texture_(options.texture) {
    for (int style = 0; style < kDoorStyles; ++style) {
      for (int right = 0; right < 2; ++right) {
        door_pictures_[style][right] = add(draw_door(style, right == 1, kDoorWidthM, kDoorHeightM));
      }
    }
    window_picture_ = add(draw_window(2.2, 1.2, 3));
    for (int gangs = 1; gangs <= 3; ++gangs) switch_pictures_[gangs - 1] = add(draw_switch(gangs));
  }

  void furnish(Wall& wall, bool outer);

 private:
  using Slots = std::vector<std::pair<double, double>>;

  const LegStyle& style_of(const Wall& wall) const { return scene_.legs[wall.leg]; }

  std::size_t add(Picture picture) {
    scene_.pictures.push_back(std::move(picture));
    return scene_.pictures.size() - 1;
  }
  std::size_t add_picture(Picture picture) { return add(std::move(picture)); }

  void bay(Wall& wall, double u0, double u1, bool outer);
  bool take(Slots& taken, double u0, double u1, double width, double& u);
  void door(Wall& wall, Slots& taken, double u0, double u1);
  void posters(Wall& wall, Slots& taken, double u0, double u1, int count);
  void notice_board(Wall& wall, Slots& taken, double u0, double u1);
  void window(Wall& wall, Slots& taken, double u0, double u1);
  void furniture(Wall& wall, Slots& taken, double u0, double u1);
  void duct(Wall& wall, Slots& taken, double u0, double u1);
  void marks(Wall& wall, double u0, double u1);
  void fading(Wall& wall, Decal decal);
  Box& box(const Wall& wall, double u0, double u1, double z0, double z1, double depth,
           double albedo);
  void frame(const Wall& wall, double u0, double u1, double z0, double z1, bool sill, double bar,
             double depth, double albedo);

  Scene& scene_;
  Random random_;
  double texture_;
  int room_ = 101;
  std::size_t door_pictures_[kDoorStyles][2] = {};
  std::size_t window_picture_ = 0;
  std::size_t switch_pictures_[3] = {};
};

/// A box that stands out from the wall by `depth`.
Box& Builder::box(const Wall& wall, double u0, double u1, double z0, double z1, double depth,
                  double albedo) {
  const double a = std::min(wall.u_sign() * u0, wall.u_sign() * u1);
  const double b = std::max(wall.u_sign() * u0, wall.u_sign() * u1);
  const double near = std::min(wall.at, wall.at + wall.facing * depth);
  const double far = std::max(wall.at, wall.at + wall.facing * depth);
  Box out;
  out.albedo = albedo;
  out.lo = wall.axis == 0 ? Vec3{near, a, z0} : Vec3{a, near, z0};
  out.hi = wall.axis == 0 ? Vec3{far, b, z1} : Vec3{b, far, z1};
  scene_.boxes.push_back(out);
  return scene_.boxes.back();
}

/// Bars round an opening; no lower bar without `sill`.
void Builder::frame(const Wall& wall, double u0, double u1, double z0, double z1, bool sill,
                    double bar, double depth, double albedo) {
  box(wall, u0 - bar, u0, z0, z1 + bar, depth, albedo);
  box(wall, u1, u1 + bar, z0, z1 + bar, depth, albedo);
  box(wall, u0, u1, z1, z1 + bar, depth, albedo);
  if (sill) box(wall, u0 - bar, u1 + bar, z0 - bar, z0, depth, albedo);
}

/// Finds a free place of `width` in [u0, u1]; false if a few tries find none.
bool Builder::take(Slots& taken, double u0, double u1, double width, double& u) {
  for (int attempt = 0; attempt < 10 && u1 - u0 > width; ++attempt) {
    u = random_.uniform(u0, u1 - width);
    const bool free = std::none_of(taken.begin(), taken.end(), [&](const auto& slot) {
      return u < slot.second + 0.08 && slot.first - 0.08 < u + width;
    });
    if (!free) continue;
    taken.emplace_back(u, u + width);
    return true;
  }
  return false;
}

/// Adds point-like texture: fewer and paler the lower the texture option is.
void Builder::fading(Wall& wall, Decal decal) {
  const bool kept = random_.uniform() < std::sqrt(texture_);
  if (!kept) return;
  decal.opacity = 0.25 + 0.75 * texture_;
  wall.decals.push_back(decal);
}

void Builder::door(Wall& wall, Slots& taken, double u0, double u1) {
  const LegStyle& leg = style_of(wall);
  const bool two_leaves = random_.chance(0.25);
  const double width = two_leaves ? leg.door_width_m + 0.75 : leg.door_width_m;
  const double height = leg.door_height_m;
  double u = 0;
  if (!take(taken, u0, u1, width + 0.24, u)) return;
  u += 0.12;
  const int style = random_.integer(0, kDoorStyles - 1);
  const bool right = random_.chance(0.5);
  const double frame_albedo = (random_.chance(0.5) ? 225 : 85) + leg.frame_tone;
  const auto leaf = [&](double from, double to, bool handle_right) {
    const std::size_t picture = door_pictures_[style][handle_right];
    wall.decals.push_back({from, to, 0, height, picture, 1, false, leg.door_tone});
  };
  if (two_leaves) {
    leaf(u, u + width / 2, true);
    leaf(u + width / 2, u + width, false);
  } else {
    leaf(u, u + width, right);
  }
  frame(wall, u, u + width, 0, height, false, leg.frame_bar_m, leg.frame_depth_m, frame_albedo);
  double plate = right ? u + width + 0.14 : u - 0.34;
  const double up = leg.fitting_z_m;
  fading(wall,
         {plate, plate + 0.2, 1.5 + up, 1.64 + up, add_picture(draw_plate(random_, room_++))});
  const double gang = right ? u + width + 0.14 : u - 0.14 - 0.085;
  wall.decals.push_back({gang, gang + 0.085, 1.05 + up, 1.135 + up, switch_pictures_[0]});
  if (random_.chance(0.3)) {
    fading(wall, {u + width / 2 - 0.25, u + width / 2 + 0.25, height + 0.12, height + 0.3,
                  add_picture(draw_sign(random_, 0.5, 0.18))});
  }
}

void Builder::posters(Wall& wall, Slots& taken, double u0, double u1, int count) {
  for (int i = 0; i < count; ++i) {
    const double width = random_.uniform(0.35, 0.9);
    const double height = width * random_.uniform(0.75, 1.5);
    double u = 0;
    if (!take(taken, u0, u1, width, u)) continue;
    const double z = random_.uniform(1.35, 1.65) - height / 2;
    fading(wall, {u, u + width, z, z + height, add_picture(draw_poster(random_, width, height))});
  }
}

void Builder::notice_board(Wall& wall, Slots& taken, double u0, double u1) {
  const double width = random_.uniform(1.0, 1.8);
  double u = 0;
  if (!take(taken, u0, u1, width + 0.1, u)) return;
  u += 0.05;
  const double z = 1.0 + style_of(wall).fitting_z_m;
  fading(wall, {u, u + width, z, z + 0.9, add_picture(draw_notice_board(random_, width, 0.9))});
  frame(wall, u, u + width, z, z + 0.9, true, 0.03, 0.02, random_.chance(0.5) ? 70 : 215);
}

void Builder::window(Wall& wall, Slots& taken, double u0, double u1) {
  double u = 0;
  if (!take(taken, u0, u1, 2.4, u)) return;
  const double z = 0.95 + style_of(wall).fitting_z_m;
  wall.decals.push_back({u + 0.1, u + 2.3, z, z + 1.2, window_picture_});
  frame(wall, u + 0.1, u + 2.3, z, z + 1.2, true, 0.05, 0.06, 225);
  if (random_.chance(0.7)) box(wall, u + 0.3, u + 2.1, 0.15, 0.75, 0.1, 205);  // radiator
}

void Builder::furniture(Wall& wall, Slots& taken, double u0, double u1) {
  const int kind = random_.integer(0, 3);
  const double width = kind == 0 ? 0.8 : kind == 1 ? 0.32 : kind == 2 ? 1.2 : 0.18;
  double u = 0;
  if (!take(taken, u0, u1, width, u)) return;
  if (kind == 0) {
    const double height = random_.uniform(0.9, 1.6);
    const auto picture = static_cast<int>(add_picture(draw_cabinet(random_, 0.8, height)));
    box(wall, u, u + width, 0, height, 0.35, 130).picture = picture;
  } else if (kind == 1) {
    box(wall, u, u + width, 0, random_.uniform(0.45, 0.7), 0.3, random_.uniform(50, 110));
  } else if (kind == 2) {
    box(wall, u, u + width, 0.40, 0.46, 0.36, 95);
    box(wall, u + 0.08, u + 0.14, 0, 0.40, 0.32, 60);
    box(wall, u + width - 0.14, u + width - 0.08, 0, 0.40, 0.32, 60);
  } else {
    box(wall, u, u + width, 0.75, 1.25, 0.16, 70);
    fading(wall, {u - 0.01, u + 0.19, 1.4, 1.6, add_picture(draw_sign(random_, 0.2, 0.2))});
  }
}

/// A cable duct down from the ceiling to a row of sockets: structure that marks a place by lines.
void Builder::duct(Wall& wall, Slots& taken, double u0, double u1) {
  const int gangs = random_.integer(1, 3);
  const double width = 0.085 * gangs;
  double u = 0;
  if (!take(taken, u0, u1, width, u)) return;
  const double end = random_.chance(0.5) ? 0.38 : random_.uniform(0.9, 1.2);
  box(wall, u + width / 2 - 0.025, u + width / 2 + 0.025, end, scene_.height_m, 0.03, 215);
  wall.decals.push_back({u, u + width, end - 0.085, end, switch_pictures_[gangs - 1]});
}

void Builder::marks(Wall& wall, double u0, double u1) {
  const int count = random_.integer(1, 4);
  for (int i = 0; i < count; ++i) {
    const double u = random_.uniform(u0, u1 - 0.5);
    const double z = random_.chance(0.6) ? random_.uniform(0.15, 0.8) : random_.uniform(0.8, 2.2);
    fading(wall, {u, u + 0.5, z, z + 0.3, add_picture(draw_marks(random_)), 1, true});
  }
}

void Builder::bay(Wall& wall, double u0, double u1, bool outer) {
  Slots taken;
  marks(wall, u0, u1);
  const double kind = random_.uniform();
  if (kind < 0.42) door(wall, taken, u0, u1);
  if (kind >= 0.42 && kind < 0.52) notice_board(wall, taken, u0, u1);
  if (kind >= 0.52 && kind < 0.66 && outer) window(wall, taken, u0, u1);
  if (kind >= 0.66 && kind < 0.82) furniture(wall, taken, u0, u1);
  if (random_.chance(0.45)) posters(wall, taken, u0, u1, random_.integer(1, 2));
  if (random_.chance(0.3)) duct(wall, taken, u0, u1);
}

void Builder::furnish(Wall& wall, bool outer) {
  const double lo = wall.u_lo() + 0.5;
  const double hi = wall.u_hi() - 0.5;
  const LegStyle& leg = style_of(wall);
  const int bays = static_cast<int>((hi - lo - leg.pillar_m) / leg.bay_m);
  wall.rail = random_.chance(0.35);
  wall.albedo = random_.uniform(172, 196) + leg.wall_tone;
  if (bays < 1) {
    if (hi - lo > 1) bay(wall, lo, hi, outer);
    return;
  }
  const double half = leg.pillar_m / 2;
  const double spare = hi - lo - leg.pillar_m - bays * leg.bay_m;
  const double start = (lo + hi - bays * leg.bay_m) / 2 + leg.bay_shift * spare;
  for (int i = 0; i <= bays; ++i) {
    const double u = start + i * leg.bay_m;
    box(wall, u - half, u + half, 0, scene_.height_m, leg.pillar_depth_m, 200 + leg.pillar_tone);
    if (i < bays) bay(wall, u + half + 0.05, u + leg.bay_m - half - 0.05, outer);
  }
}

/// The corridor's wall on one side (+1 left, -1 right) of the leg from corner i.
Wall make_wall(const Scene& scene, std::size_t i, int side) {
  const std::size_t n = scene.corners.size();
  const auto ahead_of = [&](std::size_t k) {
    const Vec3 d = scene.corners[(k + 1) % n] - scene.corners[k % n];
    return (1 / (std::abs(d.x) + std::abs(d.y))) * d;
  };
  const auto left_of = [](Vec3 v) { return Vec3{-v.y, v.x, 0}; };
  const double half = side * scene.width_m / 2;
  const Vec3 before = left_of(ahead_of(i + n - 1));
  const Vec3 here = left_of(ahead_of(i));
  const Vec3 after = left_of(ahead_of(i + 1));
  const Vec3 from = scene.corners[i] + half * (before + here);
  const Vec3 to = scene.corners[(i + 1) % n] + half * (here + after);
  Wall wall;
  wall.leg = i;
  wall.axis = std::abs(here.x) > 0.5 ? 0 : 1;
  const bool x_plane = wall.axis == 0;
  wall.at = x_plane ? from.x : from.y;
  wall.lo = x_plane ? std::min(from.y, to.y) : std::min(from.x, to.x);
  wall.hi = x_plane ? std::max(from.y, to.y) : std::max(from.x, to.x);
  wall.facing = (x_plane ? here.x : here.y) * side > 0 ? -1 : 1;
  return wall;
}

void add_lights(Scene& scene, Random& random, bool lap_change) {
  const std::size_t n = scene.corners.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 leg = scene.corners[(i + 1) % n] - scene.corners[i];
    const double length = std::abs(leg.x) + std::abs(leg.y);
    const Vec3 ahead = (1 / length) * leg;
    const LegStyle& style = scene.legs[i];
    const Vec3 aside = style.lamp_aside_m * Vec3{-ahead.y, ahead.x, 0};
    const double half_along = style.lamp_half_along_m;
    const double half_across = style.lamp_half_across_m;
    const int count = std::max(1, static_cast<int>(length / style.lamp_pitch_m));
    for (int k = 0; k < count; ++k) {
      const Vec3 centre =
          scene.corners[i] + (length * (k + 0.5) / count + style.lamp_shift_m) * ahead + aside;
      const double hx = std::abs(ahead.x) > 0.5 ? half_along : half_across;
      const double hy = std::abs(ahead.x) > 0.5 ? half_across : half_along;
      Light light{centre.x - hx, centre.x + hx, centre.y - hy, centre.y + hy, {1, 1}};
      light.level[0] = random.chance(0.1) ? 0 : random.uniform(0.85, 1);
      const bool toggled = random.chance(0.2);
      light.level[1] = lap_change && toggled ? (light.level[0] > 0 ? 0 : 1) : light.level[0];
      scene.lights.push_back(light);
    }
  }
}

FloorGrid make_light_map(const Scene& scene, int lap) {
  double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9;
  for (const Vec3& corner : scene.corners) {
    x0 = std::min(x0, corner.x - 3);
    y0 = std::min(y0, corner.y - 3);
    x1 = std::max(x1, corner.x + 3);
    y1 = std::max(y1, corner.y + 3);
  }
  constexpr double kCell = 0.25;
  constexpr double kReach = 6;
  FloorGrid grid(x0, y0, x1, y1, kCell);
  for (const Light& light : scene.lights) {
    const double x = (light.x0 + light.x1) / 2;
    const double y = (light.y0 + light.y1) / 2;
    const int c0 = std::max(0, static_cast<int>((x - kReach - x0) / kCell));
    const int r0 = std::max(0, static_cast<int>((y - kReach - y0) / kCell));
    const int c1 = std::min(grid.columns() - 1, static_cast<int>((x + kReach - x0) / kCell));
    const int r1 = std::min(grid.rows() - 1, static_cast<int>((y + kReach - y0) / kCell));
    for (int r = r0; r <= r1; ++r) {
      for (int c = c0; c <= c1; ++c) {
        const double dx = grid.x_of(c) - x;
        const double dy = grid.y_of(r) - y;
        const double d2 = dx * dx + dy * dy;
        const double fade = std::max(0.0, 1 - d2 / (kReach * kReach));
        grid.at(c, r) += static_cast<float>(light.level[lap] * fade / (1 + d2 / 1.7));
      }
    }
  }
  return grid;
}

}  // namespace

FloorGrid::FloorGrid(double x0, double y0, double x1, double y1, double cell_m)
    : x0_(x0),
      y0_(y0),
      cell_(cell_m),
      columns_(static_cast<int>((x1 - x0) / cell_m) + 2),
      rows_(static_cast<int>((y1 - y0) / cell_m) + 2),
      values_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), 0) {}

float& FloorGrid::at(int column, int row) {
  return values_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                 static_cast<std::size_t>(column)];
}

double FloorGrid::read(double x, double y) const {
  const double gx = std::clamp((x - x0_) / cell_, 0.0, columns_ - 1.001);
  const double gy = std::clamp((y - y0_) / cell_, 0.0, rows_ - 1.001);
  const int c = static_cast<int>(gx);
  const int r = static_cast<int>(gy);
  const double fx = gx - c;
  const double fy = gy - r;
  const float* v = &values_[static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) +
                            static_cast<std::size_t>(c)];
  const double top = v[0] + fx * (v[1] - v[0]);
  const double bottom = v[columns_] + fx * (v[columns_ + 1] - v[columns_]);
  return top + fy * (bottom - top);
}

Scene build_scene(const SceneOptions& options) {
  Scene scene;
  scene.grain = options.texture;
  scene.seams = std::min(1.0, 2 * options.texture);
  Random random(mix64(options.seed));
  scene.corners = make_floor_plan(options.loop_m, scene.corner_radius_m, random);
  for (std::size_t i = 0; i < scene.corners.size(); ++i) {
    scene.legs.push_back(make_leg_style(options.seed, i, options.sameness));
  }
  scene.leg_map = LegMap(scene.corners, scene.width_m);
  Builder builder(scene, options);
  for (std::size_t i = 0; i < scene.corners.size(); ++i) {
    for (const int side : {1, -1}) {
      scene.walls.push_back(make_wall(scene, i, side));
      builder.furnish(scene.walls.back(), side == -1);
    }
  }
  add_lights(scene, random, options.lap_change);
  for (int lap = 0; lap < 2; ++lap) scene.light_maps[lap] = make_light_map(scene, lap);
  return scene;
}

}  // namespace loopd::sequence
