#include "features/point_extractor.h"

#include <algorithm>

#include "features/corner_selection.h"
#include "features/fast_corners.h"
#include "features/image_pyramid.h"
#include "features/orb_descriptor.h"
#include "features/simd.h"
#include "features/smoothing.h"

namespace loopd {
namespace {

constexpr int kBorderPx = kPatchPx;  // in which no point is found, at every level
constexpr int kSmallestPx = 2 * kBorderPx + 2;
// Harris' measure orders better than FAST's contrast but costs more: only twice the corners wanted
// are ranked by it, as in ORB.
constexpr std::size_t kRankedByHarris = 2;

// Levels that still hold a patch between their borders.
int usable_levels(int smaller_side_px, double scale_factor, int levels) {
  int usable = 0;
  for (double side = smaller_side_px; usable < levels && side >= kSmallestPx; ++usable)
    side /= scale_factor;
  return usable;
}

}  // namespace

class PointExtractor::Impl {
 public:
  Impl(const FeaturesConfig& config, SimdForm form)
      : config_(config), form_(form), pyramid_(form), fast_(form), smoothing_(form) {}

  void extract(const LumaView& image, std::vector<Point>& points,
               std::vector<Descriptor>& descriptors) {
    pyramid_.start(image, config_.scale_factor, config_.levels);
    extract(pyramid_, points, descriptors);
  }

  void extract(ImagePyramid& pyramid, std::vector<Point>& points,
               std::vector<Descriptor>& descriptors) {
    points.clear();
    descriptors.clear();
    const LumaView image = pyramid.level(0);
    const int levels = usable_levels(std::min(image.width_px, image.height_px),
                                     config_.scale_factor, config_.levels);
    if (config_.points == 0 || levels == 0) return;
    share_out(levels);
    double factor = 1;
    for (int i = 0; i < levels; ++i) {
      if (i == pyramid.built()) pyramid.build_next();
      const LumaView level = pyramid.level(i);
      find(level, quota_[static_cast<std::size_t>(i)]);
      describe(level, image, static_cast<float>(kPatchPx * factor), points, descriptors);
      factor *= config_.scale_factor;
    }
  }

 private:
  // Points of each level, fewer by the scale factor from each to the next (Rublee et al. 2011,
  // section 6.1); the coarsest takes what rounding leaves.
  void share_out(int levels) {
    if (quota_.size() == static_cast<std::size_t>(levels)) return;
    quota_.clear();
    const double shrink = 1 / config_.scale_factor;
    double sum = 0;
    for (int i = 0; i < levels; ++i) sum = sum * shrink + 1;
    double share = config_.points / sum;
    auto left = static_cast<std::size_t>(config_.points);
    for (int i = 0; i < levels; ++i, share *= shrink) {
      const bool last = i + 1 == levels;
      quota_.push_back(last ? left : std::min(left, static_cast<std::size_t>(share + 0.5)));
      left -= quota_.back();
    }
  }

  void find(const LumaView& level, std::size_t quota) {
    fast_.find(level, kBorderPx, config_.fast_threshold, corners_);
    if (corners_.size() <= quota) return;
    selection_.select(kRankedByHarris * quota, corners_);
    score_by_harris(form_, level, corners_);
    selection_.select(quota, corners_);
  }

  void describe(const LumaView& level, const LumaView& image, float size_px,
                std::vector<Point>& points, std::vector<Descriptor>& descriptors) {
    if (corners_.empty()) return;
    const LumaView smoothed = smoothing_.smooth(level, kBorderPx - kPatchRadiusPx - 1);
    const float across = static_cast<float>(image.width_px) / static_cast<float>(level.width_px);
    const float down = static_cast<float>(image.height_px) / static_cast<float>(level.height_px);
    for (const Corner& c : corners_) {
      const float angle = orientation_deg(intensity_moments(form_, level, c.x_px, c.y_px));
      points.push_back({(static_cast<float>(c.x_px) + 0.5F) * across - 0.5F,
                        (static_cast<float>(c.y_px) + 0.5F) * down - 0.5F, size_px, angle});
      descriptors.push_back(describer_.describe(smoothed, c.x_px, c.y_px, angle));
    }
  }

  const FeaturesConfig config_;
  const SimdForm form_;
  ImagePyramid pyramid_;
  FastCorners fast_;
  CornerSelection selection_;
  Smoothing smoothing_;
  OrbDescriber describer_;
  std::vector<std::size_t> quota_;
  std::vector<Corner> corners_;
};

PointExtractor::PointExtractor(const FeaturesConfig& config, SimdForm form)
    : impl_(std::make_unique<Impl>(config, form)) {}
PointExtractor::~PointExtractor() = default;

void PointExtractor::extract(const LumaView& image, std::vector<Point>& points,
                             std::vector<Descriptor>& descriptors) {
  impl_->extract(image, points, descriptors);
}
void PointExtractor::extract(ImagePyramid& pyramid, std::vector<Point>& points,
                             std::vector<Descriptor>& descriptors) {
  impl_->extract(pyramid, points, descriptors);
}

}  // namespace loopd
