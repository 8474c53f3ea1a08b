#include "features/corner_selection.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <functional>

namespace loopd {
namespace {

constexpr int kBlock = 7;
constexpr std::size_t kLanes = 8;  // the eighth counts for nothing

using Lanes = std::array<std::int16_t, kLanes>;
using Sums = std::array<std::int32_t, kLanes>;

LOOPD_INLINE float harris_in(const std::uint8_t* corner, std::ptrdiff_t stride) {
  std::array<Lanes, kBlock + 2> across, along;  // of each row: difference and smoothing along x
  for (std::size_t r = 0; r < kBlock + 2; ++r) {
    const std::uint8_t* p = corner + static_cast<std::ptrdiff_t>(r) * stride;
    for (std::size_t i = 0; i < kLanes; ++i) {
      across[r][i] = static_cast<std::int16_t>(p[i + 2] - p[i]);
      along[r][i] = static_cast<std::int16_t>(p[i] + 2 * p[i + 1] + p[i + 2]);
    }
  }
  Sums xx{}, yy{}, xy{};
  for (std::size_t r = 0; r < kBlock; ++r)
    for (std::size_t i = 0; i < kLanes; ++i) {
      const auto dx =
          static_cast<std::int16_t>(across[r][i] + 2 * across[r + 1][i] + across[r + 2][i]);
      const auto dy = static_cast<std::int16_t>(along[r + 2][i] - along[r][i]);
      xx[i] += dx * dx;
      yy[i] += dy * dy;
      xy[i] += dx * dy;
    }
  std::int64_t a = 0, b = 0, c = 0;
  for (std::size_t i = 0; i < kBlock; ++i) a += xx[i], b += yy[i], c += xy[i];
  // 25 (det - 0.04 trace^2), exact: at most 25 (49 * 1020^2)^2 < 2^57.
  return static_cast<float>(std::max<std::int64_t>(0, 25 * (a * b - c * c) - (a + b) * (a + b)));
}

LOOPD_INLINE void score_in(const LumaView& image, std::span<Corner> corners) {
  for (Corner& corner : corners)
    corner.score =
        harris_in(image.data + static_cast<std::ptrdiff_t>(corner.y_px - 4) * image.stride_bytes +
                      (corner.x_px - 4),
                  image.stride_bytes);
}

void score_baseline(const LumaView& image, std::span<Corner> corners) { score_in(image, corners); }
#if defined(__x86_64__)
LOOPD_AVX2 void score_avx2(const LumaView& image, std::span<Corner> corners) {
  score_in(image, corners);
}
#endif

// Greater is better; of equal scores the first in reading order is. A total order.
std::uint64_t key_of(float score, std::size_t index) {
  // Floats that are not negative order as their bits do.
  return (static_cast<std::uint64_t>(std::bit_cast<std::uint32_t>(score)) << 32) |
         (0xffffffffu - static_cast<std::uint32_t>(index));
}

std::size_t index_of(std::uint64_t key) { return 0xffffffffu - static_cast<std::uint32_t>(key); }

}  // namespace

void score_by_harris([[maybe_unused]] SimdForm form, const LumaView& image,
                     std::span<Corner> corners) {
#if defined(__x86_64__)
  if (form == SimdForm::kAvx2) return score_avx2(image, corners);
#endif
  score_baseline(image, corners);
}

// Keys of each cell's corners side by side, by a counting sort.
void CornerSelection::sort_into_cells(const std::vector<Corner>& corners) {
  int columns = 0, rows = 0;
  for (const Corner& c : corners) {
    columns = std::max(columns, c.x_px / kCellPx + 1);
    rows = std::max(rows, c.y_px / kCellPx + 1);
  }
  const auto cell_of = [columns](const Corner& c) {
    return static_cast<std::size_t>(c.y_px / kCellPx * columns + c.x_px / kCellPx);
  };
  cell_start_.assign(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows) + 1, 0);
  for (const Corner& c : corners) ++cell_start_[cell_of(c)];
  for (std::size_t c = 1; c < cell_start_.size(); ++c) cell_start_[c] += cell_start_[c - 1];
  keys_.resize(corners.size());
  for (std::size_t i = corners.size(); i-- > 0;)
    keys_[--cell_start_[cell_of(corners[i])]] = key_of(corners[i].score, i);
}

// The smallest cap on a cell's corners with which at least `keep` are left.
std::size_t CornerSelection::even_cap(std::size_t keep) const {
  std::size_t too_small = 0, enough = keep;
  while (enough - too_small > 1) {
    const std::size_t cap = (too_small + enough) / 2;
    std::size_t left = 0;
    for (std::size_t c = 0; c + 1 < cell_start_.size(); ++c)
      left += std::min<std::size_t>(cap, cell_start_[c + 1] - cell_start_[c]);
    (left >= keep ? enough : too_small) = cap;
  }
  return enough;
}

void CornerSelection::keep_best_of_cells(std::size_t cap) {
  auto end = keys_.begin();
  for (std::size_t c = 0; c + 1 < cell_start_.size(); ++c) {
    const auto first = keys_.begin() + cell_start_[c];
    auto last = keys_.begin() + cell_start_[c + 1];
    if (last - first > static_cast<std::ptrdiff_t>(cap)) {
      const auto cut = first + static_cast<std::ptrdiff_t>(cap);
      std::nth_element(first, cut, last, std::greater<>());
      last = cut;
    }
    end = std::copy(first, last, end);
  }
  keys_.erase(end, keys_.end());
}

void CornerSelection::select(std::size_t keep, std::vector<Corner>& corners) {
  if (corners.size() <= keep) return;
  if (keep == 0) return corners.clear();
  sort_into_cells(corners);
  keep_best_of_cells(kCapFactor * even_cap(keep));
  if (keys_.size() > keep) {
    const auto cut = keys_.begin() + static_cast<std::ptrdiff_t>(keep);
    std::nth_element(keys_.begin(), cut, keys_.end(), std::greater<>());
    keys_.erase(cut, keys_.end());
  }
  for (Key& key : keys_) key = index_of(key);
  std::sort(keys_.begin(), keys_.end());
  std::size_t kept = 0;
  for (const Key index : keys_) corners[kept++] = corners[index];
  corners.resize(kept);
}

}  // namespace loopd
