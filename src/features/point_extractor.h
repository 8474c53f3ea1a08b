#pragma once

#include <memory>

#include "loopd/config.h"
#include "loopd/features.h"
#include "loopd/frame.h"

namespace loopd {

/// Finds and describes the ORB points of an image. Thread: one caller at a time.
class PointExtractor {
 public:
  explicit PointExtractor(const FeaturesConfig& config);
  ~PointExtractor();

  /// Replaces `points` and `descriptors` by those of `image` (none if it is smaller than the
  /// described patch). Coordinates are in pixels of `image`. Throws cv::Exception.
  void extract(const LumaView& image, std::vector<Point>& points,
               std::vector<Descriptor>& descriptors);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace loopd
