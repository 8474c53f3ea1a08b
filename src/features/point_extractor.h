#pragma once

#include <memory>
#include <vector>

#include "features/image_pyramid.h"
#include "features/simd.h"
#include "loopd/config.h"
#include "loopd/features.h"
#include "loopd/frame.h"

namespace loopd {

/// Finds and describes the ORB points of an image (Rublee, Rabaud, Konolige and Bradski 2011):
/// FAST corners on the levels of a pyramid, the best of each by Harris' measure spread over a grid,
/// their orientation by the centroid of intensity, 256 binary tests turned by it. Integers decide
/// all that is decided, so that every CPU gives the same. Thread: one caller at a time; its memory
/// is kept from image to image.
class PointExtractor {
 public:
  explicit PointExtractor(const FeaturesConfig& config, SimdForm form = fastest_simd_form());
  ~PointExtractor();

  /// Replaces `points` and `descriptors` by those of `image`, at most `features.points` (none if it
  /// is smaller than the described patch and its borders), by level and then in reading order.
  /// Coordinates are in pixels of `image`.
  void extract(const LumaView& image, std::vector<Point>& points,
               std::vector<Descriptor>& descriptors);

  /// The same for the image that `pyramid` was started on, with `features.scale_factor`; builds
  /// the levels that it needs and that are not there.
  void extract(ImagePyramid& pyramid, std::vector<Point>& points,
               std::vector<Descriptor>& descriptors);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace loopd
