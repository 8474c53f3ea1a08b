#include "features/feature_extractor.h"

#include <algorithm>

#include "features/reduce.h"

namespace loopd {
namespace {

// Centre of a pixel of the reduced image, in pixels of the full one.
float to_full(float position_px, int factor) {
  return position_px * static_cast<float>(factor) + 0.5F * static_cast<float>(factor - 1);
}

}  // namespace

FeatureExtractor::FeatureExtractor(const FeaturesConfig& config)
    : config_(config), points_(config), lines_(config) {}

void FeatureExtractor::prepare(const LumaView& image, Features& features) {
  features.clear();
  features.width_px = image.width_px;
  features.height_px = image.height_px;
  factor_ = reduction_factor(image.width_px, image.height_px, config_.max_pixels);
  pyramid_.start(reduce_image(image, factor_, reduced_), config_.scale_factor,
                 std::max(2, config_.levels));
  pyramid_.build_next();
  image_ = pyramid_.level(0);
  shrunk_ = pyramid_.level(1);
}

void FeatureExtractor::extract_points(Features& features) {
  points_.extract(pyramid_, features.points, features.point_descriptors);
  if (factor_ == 1) return;
  for (Point& p : features.points) {
    p.x_px = to_full(p.x_px, factor_);
    p.y_px = to_full(p.y_px, factor_);
    p.size_px *= static_cast<float>(factor_);
  }
}

void FeatureExtractor::extract_lines(Features& features) {
  lines_.extract(shrunk_, image_.width_px, image_.height_px, features.lines,
                 features.line_descriptors);
  if (factor_ == 1) return;
  for (Line& line : features.lines)
    for (float* position : {&line.start_x_px, &line.start_y_px, &line.end_x_px, &line.end_y_px})
      *position = to_full(*position, factor_);
}

}  // namespace loopd
