#pragma once

#include <cstdint>
#include <vector>

#include "features/image_pyramid.h"
#include "features/line_extractor.h"
#include "features/point_extractor.h"
#include "loopd/config.h"
#include "loopd/features.h"
#include "loopd/frame.h"

namespace loopd {

/// Describes an image by points and lines (paper, section 2.1). prepare() first; then the two
/// halves may run on two threads at once, since they share only the read image.
class FeatureExtractor {
 public:
  explicit FeatureExtractor(const FeaturesConfig& config);

  /// Takes the image of the coming halves, reduced to at most `features.max_pixels`, and makes the
  /// first level of its pyramid, which both read. The pixels of `image` must live until both halves
  /// are done.
  void prepare(const LumaView& image, Features& features);
  /// Fill points or lines of `features`, in full-resolution pixels.
  void extract_points(Features& features);
  void extract_lines(Features& features);

 private:
  FeaturesConfig config_;
  PointExtractor points_;
  LineExtractor lines_;
  ImagePyramid pyramid_;
  // Its levels 0 and 1: the points lane builds the others while the lines lane reads these.
  LumaView image_;
  LumaView shrunk_;
  int factor_ = 1;
  std::vector<std::uint8_t> reduced_;
};

}  // namespace loopd
