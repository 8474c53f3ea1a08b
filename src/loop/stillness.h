#pragma once

#include <cstdint>
#include <vector>

#include "loopd/config.h"
#include "loopd/features.h"

namespace loopd {

/// Tells whether the camera has moved between two images, by how many features are found again
/// where they were (same place, similar descriptor). Robust to noise and to things that move in
/// front of a standing camera, since what stays is enough. Thread: one caller at a time.
class StillnessTest {
 public:
  explicit StillnessTest(const LoopConfig& config) : config_(config) {}

  /// Share of the features of the poorer image that stayed, [0, 1]; 0 if either has none or their
  /// image sizes differ.
  double share_unmoved(const Features& before, const Features& now);
  bool is_still(const Features& before, const Features& now) {
    return share_unmoved(before, now) >= config_.still_fraction;
  }

 private:
  LoopConfig config_;
  std::vector<std::uint32_t> cell_start_;  // features of `before` sorted by grid cell
  std::vector<std::uint32_t> sorted_;
};

}  // namespace loopd
