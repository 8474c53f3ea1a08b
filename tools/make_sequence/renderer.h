#pragma once

#include <cstdint>
#include <vector>

#include "make_sequence/geometry.h"
#include "make_sequence/scene.h"

namespace loopd::sequence {

/// Light of an image before the sensor: row-major, about 0..255.
using Radiance = std::vector<float>;

/// Draws a scene by casting a ray a pixel. Pictures, seams and strips are filtered exactly over
/// the pixel's footprint; pixels on the edges of walls and boxes are sampled 16 times. Rays are
/// sorted by azimuth into bins that list what may be seen there, so cost hardly grows with scene.
///
/// The same scene, camera and pose give the same values, bit for bit. Thread: one thread each
/// (working memory inside); many renderers may share a scene, which must outlive them.
class Renderer {
 public:
  /// Precondition: field of view at most 150 degrees either way.
  Renderer(const Scene& scene, const Camera& camera);

  /// Fills `out` (resized to width x height). `lap` picks the lamps' state (lap % 2).
  /// Precondition: pitch and roll of `pose` within 5 degrees of level, position in the corridor.
  void render(const Pose& pose, int lap, Radiance& out);

  /// Of the image rendered last: each pixel's distance along the optical axis, metres.
  const std::vector<float>& depths_m() const { return depths_; }

 private:
  /// A ray in the world, unnormalised (depth 1 along the optical axis), and its derivative.
  struct Ray {
    Vec3 direction;
    Vec3 across;  ///< change of direction from one side of the sample to the other, along x
    Vec3 below;   ///< along y
  };
  struct Hit {
    double depth = 0;
    int surface = 0;  ///< walls, then boxes x 3 (by axis), then floor and ceiling
  };
  struct Item {
    double near_depth;
    int index;  ///< walls first, then boxes
  };
  struct Footprint {
    double x = 0;  ///< half extents in the world along each axis
    double y = 0;
    double z = 0;
  };
  struct DecalBuckets {
    double u0 = 0;
    std::vector<std::vector<const Decal*>> buckets;
  };

  void prepare_decals();
  void prepare_lights();
  void sort_into_bins();
  void add_to_bins(const Vec3& a, const Vec3& b, int index, bool wall);
  int bin_of(const Vec3& direction) const;
  Ray make_ray(double x_px, double y_px, double scale) const;
  Hit cast(const Vec3& direction) const;
  void cast_box(const Box& box, int index, const Vec3& direction, Hit& hit) const;
  double shade(const Ray& ray, const Hit& hit) const;
  Footprint footprint(const Ray& ray, double depth, int axis) const;
  double shade_wall(const Wall& wall, std::size_t index, const Vec3& p, const Footprint& f) const;
  double shade_box(int surface, const Vec3& p, const Footprint& f) const;
  double shade_floor(const Vec3& p, const Footprint& f) const;
  double shade_ceiling(const Vec3& p, const Footprint& f) const;
  double light_at(const Vec3& p) const;
  double grain_at(const GrainStyle& style, double u, double v, double size) const;
  double sample(double x_px, double y_px, double scale) const;
  void smooth_edges(Radiance& out);

  const Scene& scene_;
  Camera camera_;
  int first_box_;
  int floor_;
  int ceiling_;
  std::vector<DecalBuckets> decals_;  // a wall each
  std::vector<std::vector<const Light*>> lamp_cells_;
  double lamp_x0_ = 0;
  double lamp_y0_ = 0;
  int lamp_columns_ = 0;
  int lamp_rows_ = 0;
  std::vector<std::vector<float>> grain_;  // noise, halved in size from level to level

  Pose pose_;
  int lap_ = 0;
  Vec3 ahead_;  // horizontal heading
  Vec3 level_right_;
  double bin_limit_ = 0;  // tangent of the azimuth at the outer bins
  std::vector<std::vector<Item>> bins_;
  std::vector<double> bin_far_;
  std::vector<int> surfaces_;  // of each pixel's ray
  std::vector<float> depths_;
};

}  // namespace loopd::sequence
