#pragma once

#include <memory>

#include "loopd/config.h"
#include "loopd/features.h"
#include "loopd/frame.h"

namespace loopd {

/// Finds line segments (LSD, Grompone et al. 2010) and describes them (LBD). Thread: one caller at
/// a time.
class LineExtractor {
 public:
  explicit LineExtractor(const FeaturesConfig& config);
  ~LineExtractor();

  /// Replaces `lines` and `descriptors` by the longest of `image`, longest first, directed by
  /// contrast. Coordinates are in pixels of `image`. Throws cv::Exception.
  void extract(const LumaView& image, std::vector<Line>& lines,
               std::vector<Descriptor>& descriptors);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace loopd
