#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "features/fast_corners.h"
#include "features/simd.h"
#include "loopd/frame.h"

namespace loopd {

/// Replaces the scores by the corner measure of Harris (k = 0.04, Sobel gradients, 7x7 pixels), as
/// ORB ranks its corners; 0 on edges. Only its order has a meaning. Corners lie at least 6 pixels
/// inside `image`.
void score_by_harris(SimdForm form, const LumaView& image, std::span<Corner> corners);

/// Keeps the best corners such that a cluttered part of the image does not take all places.
/// Thread: one caller at a time (it keeps its memory).
class CornerSelection {
 public:
  /// A cell of the grid that spreads the corners.
  static constexpr int kCellPx = 32;
  /// A cell may keep this many times what it could if the places were shared out evenly.
  static constexpr std::size_t kCapFactor = 3;

  /// Cuts `corners` down to at most `keep`, in reading order as they came. First each cell keeps
  /// its best by score, as many as kCapFactor times the smallest cap on all cells that would still
  /// leave `keep`; of what is left the best stay. Of equal scores the first stays. Coordinates are
  /// not negative. Cost: linear in the corners.
  void select(std::size_t keep, std::vector<Corner>& corners);

 private:
  using Key = std::uint64_t;

  void sort_into_cells(const std::vector<Corner>& corners);
  std::size_t even_cap(std::size_t keep) const;
  void keep_best_of_cells(std::size_t cap);

  std::vector<std::uint32_t> cell_start_;  // of each cell in keys_, and the end
  std::vector<Key> keys_;
};

}  // namespace loopd
