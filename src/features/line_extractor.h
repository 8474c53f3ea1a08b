#pragma once

#include <memory>

#include "loopd/config.h"
#include "loopd/features.h"
#include "loopd/frame.h"

namespace loopd {

/// Finds line segments (SegmentDetector) and describes them (LBD), both on one gradient image of
/// the shrunk image. Images whose shrunk smaller side is below 12 px or whose longer one is above
/// SegmentDetector::kLargestPx have no lines. Thread: one caller at a time.
class LineExtractor {
 public:
  explicit LineExtractor(const FeaturesConfig& config);
  ~LineExtractor();

  /// Replaces `lines` and `descriptors` by the longest of `shrunk`, the first reduction of an image
  /// of `width_px` x `height_px`, in whose pixels the coordinates are; longest first, directed by
  /// contrast.
  void extract(const LumaView& shrunk, int width_px, int height_px, std::vector<Line>& lines,
               std::vector<Descriptor>& descriptors);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace loopd
