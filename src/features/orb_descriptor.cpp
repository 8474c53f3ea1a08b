#include "features/orb_descriptor.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <numbers>

#include "features/orb_pattern.h"

namespace loopd {
namespace {

constexpr int kPitch = 32;  // bytes a row of a copied patch
constexpr int kDiscSq = kPatchRadiusPx * (kPatchRadiusPx + 1);

using Row = std::array<std::uint8_t, kPitch>;

// 0xff inside the disc, which begins at byte 0 of a row.
constexpr std::array<Row, kPatchPx> disc_mask() {
  std::array<Row, kPatchPx> mask{};
  for (int y = -kPatchRadiusPx; y <= kPatchRadiusPx; ++y)
    for (int x = -kPatchRadiusPx; x <= kPatchRadiusPx; ++x)
      mask[static_cast<std::size_t>(y + kPatchRadiusPx)]
          [static_cast<std::size_t>(x + kPatchRadiusPx)] = x * x + y * y <= kDiscSq ? 0xff : 0;
  return mask;
}
constexpr auto kDisc = disc_mask();

const std::uint8_t* patch_corner(const LumaView& image, int x_px, int y_px) {
  return image.data + static_cast<std::ptrdiff_t>(y_px - kPatchRadiusPx) * image.stride_bytes +
         (x_px - kPatchRadiusPx);
}

// Column sums, plain and weighted by y, then one pass over the columns. At most 31 * 255 and
// 120 * 255 in magnitude: both fit 16 bits.
LOOPD_INLINE IntensityMoments moments_in(const std::uint8_t* corner, std::ptrdiff_t stride) {
  std::array<std::int16_t, kPitch> plain{}, weighted{};
  for (int y = 0; y < kPatchPx; ++y) {
    const std::uint8_t* row = corner + y * stride;
    const Row& mask = kDisc[static_cast<std::size_t>(y)];
    const auto weight = static_cast<std::int16_t>(y - kPatchRadiusPx);
    for (std::size_t x = 0; x < kPitch; ++x) {
      const auto value = static_cast<std::int16_t>(row[x] & mask[x]);
      plain[x] = static_cast<std::int16_t>(plain[x] + value);
      weighted[x] =
          static_cast<std::int16_t>(weighted[x] + static_cast<std::int16_t>(value * weight));
    }
  }
  IntensityMoments moments;
  for (std::size_t x = 0; x < kPitch; ++x) {
    moments.x += plain[x] * (static_cast<int>(x) - kPatchRadiusPx);
    moments.y += weighted[x];
  }
  return moments;
}

IntensityMoments moments_baseline(const std::uint8_t* corner, std::ptrdiff_t stride) {
  return moments_in(corner, stride);
}
#if defined(__x86_64__)
LOOPD_AVX2 IntensityMoments moments_avx2(const std::uint8_t* corner, std::ptrdiff_t stride) {
  return moments_in(corner, stride);
}
#endif

// atan(t) in degrees for t in [0, 1]: minimax polynomial of degree 9, odd, error below 0.001.
double atan_deg(double t) {
  const double s = t * t;
  const double atan =
      t * (0.9998660 + s * (-0.3302995 + s * (0.1801410 + s * (-0.0851330 + s * 0.0208351))));
  return atan * (180 / std::numbers::pi);
}

// Sine and cosine of turn/kTurns of a circle, without libm: Taylor's series of an angle in
// [0, pi/4], mirrored.
double sine(double angle_rad) {
  double term = angle_rad, sum = angle_rad;
  for (int n = 2; n <= 40; n += 2) {
    term *= -angle_rad * angle_rad / (n * (n + 1));
    sum += term;
  }
  return sum;
}

struct Direction {
  double cosine = 1;
  double sine = 0;
};

Direction direction_of(int turn) {
  const double angle = 2 * std::numbers::pi * turn / OrbDescriber::kTurns;
  return {sine(angle + std::numbers::pi / 2), sine(angle)};
}

std::uint16_t turned_position(int x, int y, const Direction& d) {
  const auto nearest = [](double v) { return static_cast<int>(std::floor(v + 0.5)); };
  const int column = nearest(d.cosine * x - d.sine * y) + kPatchRadiusPx;
  const int row = nearest(d.sine * x + d.cosine * y) + kPatchRadiusPx;
  assert(column >= 0 && column < kPatchPx && row >= 0 && row < kPatchPx);
  return static_cast<std::uint16_t>(row * kPitch + column);
}

}  // namespace

IntensityMoments intensity_moments([[maybe_unused]] SimdForm form, const LumaView& image, int x_px,
                                   int y_px) {
  const std::uint8_t* corner = patch_corner(image, x_px, y_px);
#if defined(__x86_64__)
  if (form == SimdForm::kAvx2) return moments_avx2(corner, image.stride_bytes);
#endif
  return moments_baseline(corner, image.stride_bytes);
}

float orientation_deg(const IntensityMoments& moments) {
  const double x = std::abs(moments.x), y = std::abs(moments.y);
  if (x == 0 && y == 0) return 0;
  double angle = y <= x ? atan_deg(y / x) : 90 - atan_deg(x / y);
  if (moments.x < 0) angle = 180 - angle;
  if (moments.y < 0) angle = 360 - angle;
  const auto rounded = static_cast<float>(angle);
  return rounded < 360 ? rounded : 0;
}

OrbDescriber::OrbDescriber() : OrbDescriber(kOrbPattern) {}

OrbDescriber::OrbDescriber(std::span<const BinaryTest, kTests> tests) : turns_(kTurns) {
  for (int turn = 0; turn < kTurns; ++turn) {
    const Direction direction = direction_of(turn);
    Turn& positions = turns_[static_cast<std::size_t>(turn)];
    for (std::size_t i = 0; i < kTests; ++i) {
      positions[2 * i] = turned_position(tests[i].ax, tests[i].ay, direction);
      positions[2 * i + 1] = turned_position(tests[i].bx, tests[i].by, direction);
    }
  }
}

Descriptor OrbDescriber::describe(const LumaView& smoothed, int x_px, int y_px,
                                  float angle_deg) const {
  std::array<std::uint8_t, kPatchPx * kPitch> patch;
  const std::uint8_t* row = patch_corner(smoothed, x_px, y_px);
  for (std::size_t y = 0; y < kPatchPx; ++y, row += smoothed.stride_bytes)
    std::memcpy(patch.data() + y * kPitch, row, kPitch);
  const int nearest = static_cast<int>(angle_deg * (kTurns / 360.0F) + 0.5F);
  const std::uint16_t* at = turns_[static_cast<std::size_t>(nearest % kTurns)].data();
  Descriptor descriptor;
  for (std::uint64_t& word : descriptor.words) {
    std::uint64_t bits = 0;
    for (int i = 0; i < 64; ++i, at += 2)
      bits |= static_cast<std::uint64_t>(patch[at[0]] < patch[at[1]]) << i;
    word = bits;
  }
  return descriptor;
}

}  // namespace loopd
