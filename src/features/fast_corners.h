#pragma once

#include <cstdint>
#include <vector>

#include "features/simd.h"
#include "loopd/frame.h"

namespace loopd {

/// A corner of one pyramid level, in its pixels.
struct Corner {
  std::int32_t x_px = 0;
  std::int32_t y_px = 0;
  float score = 0;  ///< >= 0, the larger the better
};

/// Finds FAST corners (Rosten and Drummond 2006; 9 of the 16 pixels on a circle of radius 3 all
/// brighter or all darker than the centre by more than a threshold) that are largest in their 3x3
/// neighbourhood; of equal neighbours the first in reading order stays. The score of a pixel is the
/// largest threshold at which it is no corner. It is computed without a branch from minima over
/// arcs, so clutter costs no more than texture.
/// Thread: one caller at a time (it keeps three rows of scores).
class FastCorners {
 public:
  explicit FastCorners(SimdForm form = fastest_simd_form()) : form_(form) {}

  /// Replaces `corners` by those at least `border_px` (>= 16) inside `image`, in reading order,
  /// with a score above `threshold` (1 .. 254). Images up to 32767 pixels a side; none in one that
  /// is smaller than its borders. Cost: about 0.5 ns a pixel.
  void find(const LumaView& image, int border_px, int threshold, std::vector<Corner>& corners);

 private:
  SimdForm form_;
  std::vector<std::uint8_t> rows_;
};

}  // namespace loopd
