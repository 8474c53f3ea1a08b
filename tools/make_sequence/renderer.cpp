#include "make_sequence/renderer.h"

#include <algorithm>
#include <cmath>

#include "make_sequence/random.h"

namespace loopd::sequence {
namespace {

constexpr int kBins = 512;
constexpr double kBucketM = 0.5;
constexpr double kLampCellM = 1;
constexpr double kNear = 0.02;
constexpr double kFar = 1e9;
constexpr int kGrainSize = 512;
constexpr double kGrainTexelM = 0.005;

/// Share of [x - half, x + half] inside [lo, hi].
double coverage(double x, double half, double lo, double hi) {
  const double overlap = std::min(x + half, hi) - std::max(x - half, lo);
  return overlap <= 0 ? 0 : overlap / (2 * half);
}

/// Integral from 0 to x of a comb that is 1 on [0, width) of every period.
double comb_integral(double x, double period, double width) {
  const double whole = std::floor(x / period);
  return whole * width + std::min(x - whole * period, width);
}

/// Share of [x - half, x + half] covered by seams of `width` every `period`.
double seams(double x, double half, double period, double width) {
  return (comb_integral(x + half, period, width) - comb_integral(x - half, period, width)) /
         (2 * half);
}

/// Share of the rectangle of half sizes (half_x, half_y) round `p` covered by seams of `width`.
double tile_seams(const Tiling& tiles, const Vec3& p, double half_x, double half_y, double width) {
  return 1 - (1 - seams(p.x - tiles.x0_m, half_x, tiles.size_x_m, width)) *
                 (1 - seams(p.y - tiles.y0_m, half_y, tiles.size_y_m, width));
}

double blend(double from, double to, double share) { return from + share * (to - from); }

double hash_unit(std::int64_t a, std::int64_t b) {
  const auto h =
      mix64(static_cast<std::uint64_t>(a) * 0x9e3779b1ULL ^ mix64(static_cast<std::uint64_t>(b)));
  return static_cast<double>(h >> 11) * 0x1.0p-53;
}

double component(const Vec3& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }

/// Periodic noise with blotches of several sizes, mean 0, about -1..1.
std::vector<float> make_grain() {
  std::vector<float> out(static_cast<std::size_t>(kGrainSize) * kGrainSize, 0);
  for (const int cell : {2, 4, 8, 32}) {
    const int n = kGrainSize / cell;
    for (int y = 0; y < kGrainSize; ++y) {
      for (int x = 0; x < kGrainSize; ++x) {
        const int cx = x / cell;
        const int cy = y / cell;
        const double fx = (x % cell + 0.5) / cell;
        const double fy = (y % cell + 0.5) / cell;
        const auto value = [&](int i, int j) {
          return hash_unit((i % n) * 131 + cell, j % n) - 0.5;
        };
        const double top = blend(value(cx, cy), value(cx + 1, cy), fx);
        const double bottom = blend(value(cx, cy + 1), value(cx + 1, cy + 1), fx);
        out[static_cast<std::size_t>(y * kGrainSize + x)] +=
            static_cast<float>(blend(top, bottom, fy));
      }
    }
  }
  return out;
}

std::vector<float> halve(const std::vector<float>& in, int size) {
  const int half = size / 2;
  std::vector<float> out(static_cast<std::size_t>(half) * static_cast<std::size_t>(half));
  for (int y = 0; y < half; ++y) {
    for (int x = 0; x < half; ++x) {
      const auto at = [&](int i, int j) { return in[static_cast<std::size_t>(j * size + i)]; };
      out[static_cast<std::size_t>(y * half + x)] =
          0.25F * (at(2 * x, 2 * y) + at(2 * x + 1, 2 * y) + at(2 * x, 2 * y + 1) +
                   at(2 * x + 1, 2 * y + 1));
    }
  }
  return out;
}

}  // namespace

Renderer::Renderer(const Scene& scene, const Camera& camera)
    : scene_(scene),
      camera_(camera),
      first_box_(static_cast<int>(scene.walls.size())),
      floor_(first_box_ + 3 * static_cast<int>(scene.boxes.size())),
      ceiling_(floor_ + 1),
      bins_(kBins),
      bin_far_(kBins) {
  prepare_decals();
  prepare_lights();
  grain_.push_back(make_grain());
  for (int size = kGrainSize; size > 1; size /= 2) grain_.push_back(halve(grain_.back(), size));
}

void Renderer::prepare_decals() {
  for (const Wall& wall : scene_.walls) {
    DecalBuckets out;
    out.u0 = wall.u_lo();
    out.buckets.resize(static_cast<std::size_t>((wall.hi - wall.lo) / kBucketM) + 1);
    const auto last = static_cast<int>(out.buckets.size()) - 1;
    for (const Decal& decal : wall.decals) {
      const int from = std::clamp(static_cast<int>((decal.u0 - out.u0) / kBucketM) - 1, 0, last);
      const int to = std::clamp(static_cast<int>((decal.u1 - out.u0) / kBucketM) + 1, 0, last);
      for (int i = from; i <= to; ++i) out.buckets[static_cast<std::size_t>(i)].push_back(&decal);
    }
    decals_.push_back(std::move(out));
  }
}

void Renderer::prepare_lights() {
  double x1 = -kFar;
  double y1 = -kFar;
  lamp_x0_ = lamp_y0_ = kFar;
  for (const Light& light : scene_.lights) {
    lamp_x0_ = std::min(lamp_x0_, light.x0 - 1);
    lamp_y0_ = std::min(lamp_y0_, light.y0 - 1);
    x1 = std::max(x1, light.x1 + 1);
    y1 = std::max(y1, light.y1 + 1);
  }
  lamp_columns_ = static_cast<int>((x1 - lamp_x0_) / kLampCellM) + 2;
  lamp_rows_ = static_cast<int>((y1 - lamp_y0_) / kLampCellM) + 2;
  lamp_cells_.resize(static_cast<std::size_t>(lamp_columns_) *
                     static_cast<std::size_t>(lamp_rows_));
  for (const Light& light : scene_.lights) {
    const int c0 = static_cast<int>((light.x0 - 0.3 - lamp_x0_) / kLampCellM);
    const int c1 = static_cast<int>((light.x1 + 0.3 - lamp_x0_) / kLampCellM);
    const int r0 = static_cast<int>((light.y0 - 0.3 - lamp_y0_) / kLampCellM);
    const int r1 = static_cast<int>((light.y1 + 0.3 - lamp_y0_) / kLampCellM);
    for (int r = r0; r <= r1; ++r) {
      for (int c = c0; c <= c1; ++c) {
        lamp_cells_[static_cast<std::size_t>(r * lamp_columns_ + c)].push_back(&light);
      }
    }
  }
}

Renderer::Ray Renderer::make_ray(double x_px, double y_px, double scale) const {
  const double a = (x_px - camera_.cx_px) / camera_.focal_px;
  const double b = (y_px - camera_.cy_px) / camera_.focal_px;
  const double step = scale / camera_.focal_px;
  return {pose_.forward + a * pose_.right + b * pose_.down, step * pose_.right, step * pose_.down};
}

int Renderer::bin_of(const Vec3& direction) const {
  const double tangent = dot(direction, level_right_) / dot(direction, ahead_);
  const double bin = (tangent + bin_limit_) * (kBins / (2 * bin_limit_));
  return static_cast<int>(std::clamp(bin, 0.0, kBins - 1.0));
}

/// Enters the floor-plan segment from `a` to `b` into the bins in which it may be seen.
void Renderer::add_to_bins(const Vec3& a, const Vec3& b, int index, bool wall) {
  Vec3 p{dot(a - pose_.position, level_right_), dot(a - pose_.position, ahead_), 0};
  Vec3 q{dot(b - pose_.position, level_right_), dot(b - pose_.position, ahead_), 0};
  if (p.y < kNear && q.y < kNear) return;
  if (p.y < kNear) p = p + ((kNear - p.y) / (q.y - p.y)) * (q - p);
  if (q.y < kNear) q = q + ((kNear - q.y) / (p.y - q.y)) * (p - q);
  const double to_bin = kBins / (2 * bin_limit_);
  const double first = (std::min(p.x / p.y, q.x / q.y) + bin_limit_) * to_bin;
  const double last = (std::max(p.x / p.y, q.x / q.y) + bin_limit_) * to_bin;
  if (last < 0 || first >= kBins) return;
  const int from = static_cast<int>(std::clamp(first - 1e-6, 0.0, kBins - 1.0));
  const int to = static_cast<int>(std::clamp(last + 1e-6, 0.0, kBins - 1.0));
  for (int i = from; i <= to; ++i) {
    const auto bin = static_cast<std::size_t>(i);
    bins_[bin].push_back({std::min(p.y, q.y), index});
    // What lies behind a wall that fills the bin is hidden in it.
    if (wall && first <= i && last >= i + 1) {
      bin_far_[bin] = std::min(bin_far_[bin], std::max(p.y, q.y));
    }
  }
}

void Renderer::sort_into_bins() {
  for (auto& bin : bins_) bin.clear();
  std::fill(bin_far_.begin(), bin_far_.end(), kFar);
  for (std::size_t i = 0; i < scene_.walls.size(); ++i) {
    const Wall& wall = scene_.walls[i];
    const double eye = wall.axis == 0 ? pose_.position.x : pose_.position.y;
    if ((eye - wall.at) * wall.facing <= 0) continue;  // seen from behind
    const Vec3 a = wall.axis == 0 ? Vec3{wall.at, wall.lo, 0} : Vec3{wall.lo, wall.at, 0};
    const Vec3 b = wall.axis == 0 ? Vec3{wall.at, wall.hi, 0} : Vec3{wall.hi, wall.at, 0};
    add_to_bins(a, b, static_cast<int>(i), true);
  }
  for (std::size_t i = 0; i < scene_.boxes.size(); ++i) {
    const Box& box = scene_.boxes[i];
    // The two diagonals of the base together span what the box can hide.
    const int index = first_box_ + static_cast<int>(i);
    add_to_bins({box.lo.x, box.lo.y, 0}, {box.hi.x, box.hi.y, 0}, index, false);
    add_to_bins({box.lo.x, box.hi.y, 0}, {box.hi.x, box.lo.y, 0}, index, false);
  }
  for (std::size_t i = 0; i < bins_.size(); ++i) {
    auto& bin = bins_[i];
    const double far = bin_far_[i];
    std::erase_if(bin, [far](const Item& item) { return item.near_depth > far; });
    std::sort(bin.begin(), bin.end(),
              [](const Item& a, const Item& b) { return a.index < b.index; });
    const auto same = [](const Item& a, const Item& b) { return a.index == b.index; };
    bin.erase(std::unique(bin.begin(), bin.end(), same), bin.end());
  }
}

/// Slab test; keeps the nearer of box and `hit`.
void Renderer::cast_box(const Box& box, int index, const Vec3& direction, Hit& hit) const {
  double enter = 0;
  double leave = hit.depth;
  int axis = -1;
  for (int i = 0; i < 3; ++i) {
    const double d = component(direction, i);
    const double o = component(pose_.position, i);
    const double inverse = 1 / d;  // infinite where parallel: the comparisons below still hold
    double t0 = (component(box.lo, i) - o) * inverse;
    double t1 = (component(box.hi, i) - o) * inverse;
    if (t0 > t1) std::swap(t0, t1);
    if (t0 > enter) {
      enter = t0;
      axis = i;
    }
    leave = std::min(leave, t1);
    if (enter >= leave) return;
  }
  if (axis < 0) return;  // the eye is inside
  hit = {enter, first_box_ + 3 * index + axis};
}

Renderer::Hit Renderer::cast(const Vec3& direction) const {
  const Vec3& eye = pose_.position;
  Hit hit{kFar, floor_};
  if (direction.z < 0) hit = {-eye.z / direction.z, floor_};
  if (direction.z > 0) hit = {(scene_.height_m - eye.z) / direction.z, ceiling_};
  for (const Item& item : bins_[static_cast<std::size_t>(bin_of(direction))]) {
    if (item.index >= first_box_) {
      const int box = item.index - first_box_;
      cast_box(scene_.boxes[static_cast<std::size_t>(box)], box, direction, hit);
      continue;
    }
    const Wall& wall = scene_.walls[static_cast<std::size_t>(item.index)];
    const bool x_plane = wall.axis == 0;
    const double t = x_plane ? (wall.at - eye.x) / direction.x : (wall.at - eye.y) / direction.y;
    if (!(t > 0 && t < hit.depth)) continue;
    const double along = x_plane ? eye.y + t * direction.y : eye.x + t * direction.x;
    if (along >= wall.lo && along <= wall.hi) hit = {t, item.index};
  }
  return hit;
}

/// The pixel's shadow on a plane normal to `axis`: first derivative of the hit point.
Renderer::Footprint Renderer::footprint(const Ray& ray, double depth, int axis) const {
  const double d = component(ray.direction, axis);
  const double across = component(ray.across, axis) / d;
  const double below = component(ray.below, axis) / d;
  const Vec3 dx = ray.across - across * ray.direction;
  const Vec3 dy = ray.below - below * ray.direction;
  const double half = depth / 2;
  return {half * (std::abs(dx.x) + std::abs(dy.x)) + 1e-9,
          half * (std::abs(dx.y) + std::abs(dy.y)) + 1e-9,
          half * (std::abs(dx.z) + std::abs(dy.z)) + 1e-9};
}

double Renderer::light_at(const Vec3& p) const {
  return 0.5 + 0.55 * scene_.light_maps[lap_].read(p.x, p.y);
}

/// Noise at (u, v) metres for a footprint of half size `size`, fading as blotches become small.
double Renderer::grain_at(const GrainStyle& style, double u, double v, double size) const {
  std::size_t level = 0;
  double texel = kGrainTexelM;
  for (; texel < 2 * size && level + 1 < grain_.size(); texel *= 2) ++level;
  const int n = kGrainSize >> level;
  const double x = (u * style.stretch_u + style.u0_m) / texel;
  const double y = (v * style.stretch_v + style.v0_m) / texel;
  const double x_floor = std::floor(x);
  const double y_floor = std::floor(y);
  const auto wrap = [n](double i) {
    return static_cast<int>(static_cast<std::int64_t>(i)) & (n - 1);
  };
  const int c0 = wrap(x_floor);
  const int r0 = wrap(y_floor);
  const int c1 = (c0 + 1) & (n - 1);
  const int r1 = (r0 + 1) & (n - 1);
  const std::vector<float>& g = grain_[level];
  const auto at = [&](int c, int r) {
    return static_cast<double>(g[static_cast<std::size_t>(r * n + c)]);
  };
  return blend(blend(at(c0, r0), at(c1, r0), x - x_floor),
               blend(at(c0, r1), at(c1, r1), x - x_floor), y - y_floor);
}

double Renderer::shade_wall(const Wall& wall, std::size_t index, const Vec3& p,
                            const Footprint& f) const {
  const double u = wall.u_sign() * (wall.axis == 0 ? p.y : p.x);
  const double half_u = wall.axis == 0 ? f.y : f.x;
  const LegStyle& leg = scene_.legs[wall.leg];
  double value = wall.albedo;
  if (scene_.grain > 0) {
    value += scene_.grain * 5 *
             grain_at(leg.grain, u + 7.3 * static_cast<double>(index), p.z, std::max(half_u, f.z));
  }
  if (wall.rail) {
    const double share = coverage(p.z, f.z, leg.rail_z_m, leg.rail_z_m + leg.rail_m);
    value = blend(value, 120 + leg.rail_tone, share);
  }
  const DecalBuckets& decals = decals_[index];
  const auto last = static_cast<double>(decals.buckets.size() - 1);
  const auto bucket = static_cast<std::size_t>(std::clamp((u - decals.u0) / kBucketM, 0.0, last));
  for (const Decal* decal : decals.buckets[bucket]) {
    const double share = coverage(u, half_u, decal->u0, decal->u1) *
                         coverage(p.z, f.z, decal->z0, decal->z1) * decal->opacity;
    if (share <= 0) continue;
    const Picture& picture = scene_.pictures[decal->picture];
    const double sx = picture.width() / (decal->u1 - decal->u0);
    const double sy = picture.height() / (decal->z1 - decal->z0);
    const double grey =
        decal->tone + picture.mean((u - half_u - decal->u0) * sx, (decal->z1 - p.z - f.z) * sy,
                                   (u + half_u - decal->u0) * sx, (decal->z1 - p.z + f.z) * sy);
    value = decal->multiply ? value * (1 - share * (1 - grey / 255)) : blend(value, grey, share);
  }
  // Skirting, broken only by doors, which stand on the floor and are drawn over it.
  const bool at_door = std::any_of(
      decals.buckets[bucket].begin(), decals.buckets[bucket].end(),
      [u](const Decal* decal) { return decal->z0 <= 0 && u > decal->u0 && u < decal->u1; });
  if (!at_door) {
    const double top = leg.skirting_m;
    value = blend(value, 88 + leg.skirting_tone, coverage(p.z, f.z, 0, top));
    value = blend(value, 225, coverage(p.z, f.z, top, top + 0.012));
  }
  const double top = scene_.height_m - p.z;
  const double corners = 1 - 0.25 / (1 + 120 * p.z * p.z) - 0.2 / (1 + 80 * top * top);
  return value * light_at(p) * corners * (wall.axis == 0 ? 1.0 : 0.93) * (0.8 + 0.1 * p.z);
}

double Renderer::shade_box(int surface, const Vec3& p, const Footprint& f) const {
  const int axis = (surface - first_box_) % 3;
  const Box& box = scene_.boxes[static_cast<std::size_t>((surface - first_box_) / 3)];
  double value = box.albedo;
  if (box.picture >= 0 && axis != 2) {
    const Picture& picture = scene_.pictures[static_cast<std::size_t>(box.picture)];
    const double lo = axis == 0 ? box.lo.y : box.lo.x;
    const double hi = axis == 0 ? box.hi.y : box.hi.x;
    const double u = axis == 0 ? p.y : p.x;
    const double half = axis == 0 ? f.y : f.x;
    const double sx = picture.width() / (hi - lo);
    const double sy = picture.height() / (box.hi.z - box.lo.z);
    value = picture.mean((u - half - lo) * sx, (box.hi.z - p.z - f.z) * sy, (u + half - lo) * sx,
                         (box.hi.z - p.z + f.z) * sy);
  }
  const double face = axis == 2 ? 1.08 : axis == 0 ? 1.0 : 0.88;
  return value * light_at(p) * face * (0.8 + 0.1 * p.z);
}

double Renderer::shade_floor(const Vec3& p, const Footprint& f) const {
  const LegStyle& leg = scene_.legs[scene_.leg_map.leg_at(p.x, p.y)];
  const Tiling& tiles = leg.floor;
  const double x = p.x - tiles.x0_m;
  const double y = p.y - tiles.y0_m;
  const double i = std::floor(x / tiles.size_x_m);
  const double j = std::floor(y / tiles.size_y_m);
  const double tile = hash_unit(static_cast<std::int64_t>(i), static_cast<std::int64_t>(j)) - 0.5;
  double value = 112;
  // A tile's own tone fades as the footprint grows past a tile.
  const double size = std::max(f.x, f.y);
  const double least = std::min(tiles.size_x_m, tiles.size_y_m);
  value += 10 * scene_.seams * tile * std::clamp(1.5 - 3 * size / least, 0.0, 1.0);
  if (scene_.grain > 0) value += scene_.grain * 7 * grain_at(leg.grain, p.x, p.y, size);
  const double seam = tile_seams(tiles, p, f.x, f.y, 0.008);
  return blend(value, 65, scene_.seams * seam) * light_at(p) * 0.95;
}

double Renderer::shade_ceiling(const Vec3& p, const Footprint& f) const {
  const Tiling& panels = scene_.legs[scene_.leg_map.leg_at(p.x, p.y)].ceiling;
  const double seam = tile_seams(panels, p, f.x, f.y, 0.02);
  double value = blend(205, 150, scene_.seams * seam) * (0.52 + 0.36 * light_at(p));
  const int c = static_cast<int>((p.x - lamp_x0_) / kLampCellM);
  const int r = static_cast<int>((p.y - lamp_y0_) / kLampCellM);
  if (c < 0 || r < 0 || c >= lamp_columns_ || r >= lamp_rows_) return value;
  for (const Light* light : lamp_cells_[static_cast<std::size_t>(r * lamp_columns_ + c)]) {
    const double rim = coverage(p.x, f.x, light->x0 - 0.03, light->x1 + 0.03) *
                       coverage(p.y, f.y, light->y0 - 0.03, light->y1 + 0.03);
    const double pane =
        coverage(p.x, f.x, light->x0, light->x1) * coverage(p.y, f.y, light->y0, light->y1);
    value = blend(blend(value, 120, rim), 135 + 125 * light->level[lap_], pane);
  }
  return value;
}

double Renderer::shade(const Ray& ray, const Hit& hit) const {
  const Vec3 p = pose_.position + hit.depth * ray.direction;
  if (hit.surface < first_box_) {
    const auto index = static_cast<std::size_t>(hit.surface);
    const Wall& wall = scene_.walls[index];
    return shade_wall(wall, index, p, footprint(ray, hit.depth, wall.axis));
  }
  if (hit.surface >= floor_) {
    const Footprint f = footprint(ray, hit.depth, 2);
    return hit.surface == floor_ ? shade_floor(p, f) : shade_ceiling(p, f);
  }
  return shade_box(hit.surface, p, footprint(ray, hit.depth, (hit.surface - first_box_) % 3));
}

double Renderer::sample(double x_px, double y_px, double scale) const {
  const Ray ray = make_ray(x_px, y_px, scale);
  return shade(ray, cast(ray.direction));
}

/// Samples pixels next to another surface 4 x 4 times.
void Renderer::smooth_edges(Radiance& out) {
  const int w = camera_.width_px;
  const int h = camera_.height_px;
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      const auto i =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(w) + static_cast<std::size_t>(x);
      const auto row = static_cast<std::size_t>(w);
      const int own = surfaces_[i];
      const bool edge =
          (x > 0 && surfaces_[i - 1] != own) || (y > 0 && surfaces_[i - row] != own) ||
          (x + 1 < w && surfaces_[i + 1] != own) || (y + 1 < h && surfaces_[i + row] != own);
      if (!edge) continue;
      double sum = 0;
      for (int k = 0; k < 16; ++k) {
        sum += sample(x + (k % 4 - 1.5) / 4, y + (k / 4 - 1.5) / 4, 0.25);
      }
      out[i] = static_cast<float>(sum / 16);
    }
  }
}

void Renderer::render(const Pose& pose, int lap, Radiance& out) {
  pose_ = pose;
  lap_ = lap % 2;
  const double level = std::sqrt(pose.forward.x * pose.forward.x + pose.forward.y * pose.forward.y);
  ahead_ = {pose.forward.x / level, pose.forward.y / level, 0};
  level_right_ = {ahead_.y, -ahead_.x, 0};
  bin_limit_ = 0;
  for (const double x : {-0.5, camera_.width_px - 0.5}) {
    for (const double y : {-0.5, camera_.height_px - 0.5}) {
      const Vec3 d = make_ray(x, y, 1).direction;
      bin_limit_ = std::max(bin_limit_, std::abs(dot(d, level_right_) / dot(d, ahead_)));
    }
  }
  bin_limit_ *= 1.001;
  sort_into_bins();
  const auto pixels =
      static_cast<std::size_t>(camera_.width_px) * static_cast<std::size_t>(camera_.height_px);
  out.resize(pixels);
  surfaces_.resize(pixels);
  depths_.resize(pixels);
  for (std::size_t i = 0, y = 0; y < static_cast<std::size_t>(camera_.height_px); ++y) {
    for (std::size_t x = 0; x < static_cast<std::size_t>(camera_.width_px); ++x, ++i) {
      const Ray ray = make_ray(static_cast<double>(x), static_cast<double>(y), 1);
      const Hit hit = cast(ray.direction);
      surfaces_[i] = hit.surface;
      depths_[i] = static_cast<float>(hit.depth);
      out[i] = static_cast<float>(shade(ray, hit));
    }
  }
  smooth_edges(out);
}

}  // namespace loopd::sequence
