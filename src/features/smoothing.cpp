#include "features/smoothing.h"

#include <array>
#include <cassert>
#include <cstddef>

namespace loopd {
namespace {

constexpr int kReach = 3;
constexpr int kRing = 8;  // rows kept: the 7 of the kernel, a power of two

using Rows = std::array<const std::uint16_t*, 2 * kReach + 1>;

// sums[x] = 16 times the mean around from[x], for x in [0, count).
LOOPD_INLINE void sum_row_in(const std::uint8_t* from, std::size_t count,
                             std::uint16_t* __restrict sums) {
  const std::uint8_t* left = from - kReach;
  for (std::size_t x = 0; x < count; ++x)
    sums[x] = static_cast<std::uint16_t>(left[x] + left[x + 6] + 2 * (left[x + 1] + left[x + 5]) +
                                         3 * (left[x + 2] + left[x + 4]) + 4 * left[x + 3]);
}

LOOPD_INLINE void sum_columns_in(const Rows& rows, std::size_t count,
                                 std::uint8_t* __restrict out) {
  const std::uint16_t *a = rows[0], *b = rows[1], *c = rows[2], *d = rows[3], *e = rows[4],
                      *f = rows[5], *g = rows[6];
  for (std::size_t x = 0; x < count; ++x) {
    // At most 16 * 16 * 255 + 128: fits.
    const auto sum = static_cast<std::uint16_t>(a[x] + g[x] + 2 * (b[x] + f[x]) +
                                                3 * (c[x] + e[x]) + 4 * d[x] + 128);
    out[x] = static_cast<std::uint8_t>(sum >> 8);
  }
}

void sum_row_baseline(const std::uint8_t* from, std::size_t count, std::uint16_t* sums) {
  sum_row_in(from, count, sums);
}
void sum_columns_baseline(const Rows& rows, std::size_t count, std::uint8_t* out) {
  sum_columns_in(rows, count, out);
}
#if defined(__x86_64__)
LOOPD_AVX2 void sum_row_avx2(const std::uint8_t* from, std::size_t count, std::uint16_t* sums) {
  sum_row_in(from, count, sums);
}
LOOPD_AVX2 void sum_columns_avx2(const Rows& rows, std::size_t count, std::uint8_t* out) {
  sum_columns_in(rows, count, out);
}
#endif

}  // namespace

LumaView Smoothing::smooth(const LumaView& image, int margin_px) {
  assert(margin_px >= kReach);
  const auto stride = static_cast<std::size_t>(image.width_px + 31) / 32 * 32;
  pixels_.resize(stride * static_cast<std::size_t>(image.height_px));
  const LumaView smoothed{pixels_.data(), image.width_px, image.height_px,
                          static_cast<int>(stride)};
  if (image.width_px <= 2 * margin_px || image.height_px <= 2 * margin_px) return smoothed;
  auto sum_row = sum_row_baseline;
  auto sum_columns = sum_columns_baseline;
#if defined(__x86_64__)
  if (form_ == SimdForm::kAvx2) sum_row = sum_row_avx2, sum_columns = sum_columns_avx2;
#endif
  const auto count = static_cast<std::size_t>(image.width_px - 2 * margin_px);
  rows_.resize(kRing * stride);
  const auto ring = [&](int y) {
    return rows_.data() + static_cast<std::size_t>(y % kRing) * stride;
  };
  const int first = margin_px - kReach;
  for (int y = first; y < image.height_px - first; ++y) {
    sum_row(image.data + static_cast<std::ptrdiff_t>(y) * image.stride_bytes + margin_px, count,
            ring(y));
    const int middle = y - kReach;
    if (middle < margin_px) continue;
    Rows rows{};
    for (int i = 0; i < 2 * kReach + 1; ++i)
      rows[static_cast<std::size_t>(i)] = ring(middle - kReach + i);
    sum_columns(rows, count,
                pixels_.data() + static_cast<std::size_t>(middle) * stride + margin_px);
  }
  return smoothed;
}

}  // namespace loopd
