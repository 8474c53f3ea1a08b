#include "features/fast_corners.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstddef>

namespace loopd {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr int kCircle = 16;
constexpr int kWidest = 32;  // pixels a step of the widest form
// Scores of a row start here in its buffer, so that the neighbours of the first exist.
constexpr std::size_t kLead = 32;

struct Step {
  int x = 0;
  int y = 0;
};
constexpr std::array<Step, kCircle> kCirclePx{{{0, -3},
                                               {1, -3},
                                               {2, -2},
                                               {3, -1},
                                               {3, 0},
                                               {3, 1},
                                               {2, 2},
                                               {1, 3},
                                               {0, 3},
                                               {-1, 3},
                                               {-2, 2},
                                               {-3, 1},
                                               {-3, 0},
                                               {-3, -1},
                                               {-2, -2},
                                               {-1, -3}}};

using Offsets = std::array<std::ptrdiff_t, kCircle>;

Offsets circle_offsets(int stride_bytes) {
  Offsets offsets{};
  for (std::size_t i = 0; i < kCircle; ++i)
    offsets[i] = static_cast<std::ptrdiff_t>(kCirclePx[i].y) * stride_bytes + kCirclePx[i].x;
  return offsets;
}

// The largest of the minima over the 16 arcs of 9 differences. Two arcs that share 8 of their
// pixels are done at once: max(min(m, a), min(m, b)) = min(m, max(a, b)).
template <class V>
LOOPD_INLINE V best_arc(const std::array<V, kCircle>& d) {
  std::array<V, kCircle / 2> pair, four;
  for (std::size_t i = 0; i < 8; ++i) pair[i] = simd::min(d[2 * i + 1], d[(2 * i + 2) % 16]);
  for (std::size_t i = 0; i < 8; ++i) four[i] = simd::min(pair[i], pair[(i + 1) % 8]);
  V best{};
  for (std::size_t i = 0; i < 8; ++i) {
    const V eight = simd::min(four[i], four[(i + 2) % 8]);
    const V ends = simd::max(d[2 * i], d[(2 * i + 9) % 16]);
    best = simd::max(best, simd::min(eight, ends));
  }
  return best;
}

// An upper bound of the score from 4 pixels a quarter turn apart: an arc of 9 holds two that are
// neighbours among them, and min(max(a, c), max(b, d)) is the best such pair.
template <class V>
LOOPD_INLINE V bound(const std::uint8_t* centre, V value, const Offsets& circle,
                     std::size_t first) {
  const V a = simd::load<V>(centre + circle[first]);
  const V b = simd::load<V>(centre + circle[first + 4]);
  const V c = simd::load<V>(centre + circle[first + 8]);
  const V d = simd::load<V>(centre + circle[first + 12]);
  const V brighter = simd::min(simd::max(a, c), simd::max(b, d));
  const V darker = simd::max(simd::min(a, c), simd::min(b, d));
  return simd::max(simd::minus(brighter, value), simd::minus(value, darker));
}

template <class V>
LOOPD_INLINE V scores_at(const std::uint8_t* centre, V value, const Offsets& circle) {
  std::array<V, kCircle> brighter, darker;
  for (std::size_t i = 0; i < kCircle; ++i) {
    const V pixel = simd::load<V>(centre + circle[i]);
    brighter[i] = simd::minus(pixel, value);
    darker[i] = simd::minus(value, pixel);
  }
  return simd::max(best_arc(brighter), best_arc(darker));
}

// Scores of `count` pixels from `centre` on, 0 where not above the threshold.
template <class V>
LOOPD_INLINE bool score_row_in(const std::uint8_t* centre, const Offsets& circle, int threshold,
                               std::size_t count, std::uint8_t* scores) {
  const V limit = simd::all<V>(static_cast<std::uint8_t>(threshold));
  bool found = false;
  for (std::size_t x = 0; x < count; x += sizeof(V)) {
    const V value = simd::load<V>(centre + x);
    V score{};
    const V most =
        simd::min(bound(centre + x, value, circle, 0), bound(centre + x, value, circle, 2));
    if (simd::any(simd::minus(most, limit))) {
      const V all = scores_at(centre + x, value, circle);
      score = all > limit ? all : V{};
      found = found || simd::any(score);
    }
    simd::store(scores + x, score);
  }
  return found;
}

// Keeps of `count` scores those that beat their neighbours.
template <class V>
LOOPD_INLINE void keep_largest_in(const std::uint8_t* above, const std::uint8_t* row,
                                  const std::uint8_t* below, std::size_t count,
                                  std::uint8_t* kept) {
  using simd::load;
  using simd::max;
  for (std::size_t x = 0; x < count; x += sizeof(V)) {
    const V earlier = max(max(load<V>(above + x - 1), load<V>(above + x)),
                          max(load<V>(above + x + 1), load<V>(row + x - 1)));
    const V later = max(max(load<V>(below + x - 1), load<V>(below + x)),
                        max(load<V>(below + x + 1), load<V>(row + x + 1)));
    const V score = load<V>(row + x);
    const V largest = max(score, later) == score ? score : V{};
    simd::store(kept + x, max(largest, earlier) == earlier ? V{} : largest);
  }
}

struct Form {
  bool (*score_row)(const std::uint8_t*, const Offsets&, int, std::size_t, std::uint8_t*);
  void (*keep_largest)(const std::uint8_t*, const std::uint8_t*, const std::uint8_t*, std::size_t,
                       std::uint8_t*);
};

#define LOOPD_FAST_FORM(name, target, Vector)                                                    \
  target bool score_row_##name(const std::uint8_t* centre, const Offsets& circle, int threshold, \
                               std::size_t count, std::uint8_t* scores) {                        \
    return score_row_in<Vector>(centre, circle, threshold, count, scores);                       \
  }                                                                                              \
  target void keep_largest_##name(const std::uint8_t* above, const std::uint8_t* row,            \
                                  const std::uint8_t* below, std::size_t count,                  \
                                  std::uint8_t* kept) {                                          \
    keep_largest_in<Vector>(above, row, below, count, kept);                                     \
  }
LOOPD_FAST_FORM(baseline, , simd::Bytes16)
#if defined(__x86_64__)
LOOPD_FAST_FORM(avx2, LOOPD_AVX2, simd::Bytes32)
#endif

Form form_of([[maybe_unused]] SimdForm form) {
#if defined(__x86_64__)
  if (form == SimdForm::kAvx2) return {score_row_avx2, keep_largest_avx2};
#endif
  return {score_row_baseline, keep_largest_baseline};
}

// Appends the non-zero bytes of a row, eight looked at together.
void append_corners(const std::uint8_t* kept, std::size_t count, int first_x, int y,
                    std::vector<Corner>& corners) {
  for (std::size_t x = 0; x < count; x += 8) {
    std::uint64_t eight = 0;
    std::memcpy(&eight, kept + x, 8);
    while (eight != 0) {
      const int byte = std::countr_zero(eight) / 8;
      corners.push_back({first_x + static_cast<int>(x) + byte, y,
                         static_cast<float>((eight >> (8 * byte)) & 0xff)});
      eight &= ~(std::uint64_t{0xff} << (8 * byte));
    }
  }
}

}  // namespace

void FastCorners::find(const LumaView& image, int border_px, int threshold,
                       std::vector<Corner>& corners) {
  assert(border_px >= 16 && threshold >= 1 && threshold <= 254);
  corners.clear();
  if (std::min(image.width_px, image.height_px) <= 2 * border_px) return;
  const Form form = form_of(form_);
  const Offsets circle = circle_offsets(image.stride_bytes);
  // Scores reach one pixel beyond the region on each side: its neighbours suppress too.
  const int first_x = border_px - 1;
  const auto scored = static_cast<std::size_t>(image.width_px - 2 * first_x);
  const std::size_t inner = scored - 2;
  const std::size_t pitch = kLead + (scored + kWidest - 1) / kWidest * kWidest + kWidest;
  rows_.assign(4 * pitch, 0);
  std::array<std::uint8_t*, 3> rows{};
  for (std::size_t i = 0; i < 3; ++i) rows[i] = rows_.data() + i * pitch + kLead;
  std::uint8_t* kept = rows_.data() + 3 * pitch;
  std::array<bool, 3> found{};
  const int last_y = image.height_px - border_px;
  for (int y = border_px - 1; y <= last_y; ++y) {
    std::rotate(rows.begin(), rows.begin() + 1, rows.end());
    std::rotate(found.begin(), found.begin() + 1, found.end());
    const std::uint8_t* centre =
        image.data + static_cast<std::ptrdiff_t>(y) * image.stride_bytes + first_x;
    found[2] = form.score_row(centre, circle, threshold, scored, rows[2]);
    if (y < border_px + 1 || !found[1]) continue;
    form.keep_largest(rows[0] + 1, rows[1] + 1, rows[2] + 1, inner, kept);
    std::memset(kept + inner, 0, kWidest);
    append_corners(kept, inner, border_px, y - 1, corners);
  }
}

}  // namespace loopd
