#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "features/simd.h"
#include "loopd/features.h"
#include "loopd/frame.h"

namespace loopd {

/// The patch of a point: what its orientation and its descriptor see.
constexpr int kPatchRadiusPx = 15;
constexpr int kPatchPx = 2 * kPatchRadiusPx + 1;

/// Moments of the intensity in the disc of the patch: sums of x I and y I about its centre.
struct IntensityMoments {
  std::int32_t x = 0;
  std::int32_t y = 0;
  friend bool operator==(const IntensityMoments&, const IntensityMoments&) = default;
};

/// Of the patch around pixel (x_px, y_px), at least 16 pixels inside `image`. Exact.
IntensityMoments intensity_moments(SimdForm form, const LumaView& image, int x_px, int y_px);

/// Direction of the centroid, degrees in [0, 360), clockwise on the screen; 0 if there is none.
/// From a polynomial: the same on every CPU, within 0.01 degrees.
float orientation_deg(const IntensityMoments& moments);

/// One binary test: whether the smoothed image is darker at `a` than at `b`; pixels about the
/// centre of an unrotated patch, inside its disc.
struct BinaryTest {
  std::int8_t ax = 0;
  std::int8_t ay = 0;
  std::int8_t bx = 0;
  std::int8_t by = 0;
};

/// Steered BRIEF (Rublee et al. 2011, section 4): 256 binary tests on the smoothed patch, turned by
/// the point's orientation in 64 steps (5.6 degrees). The tests are ours, learned as that paper
/// describes (see orb_pattern.h). Thread-safe after construction.
class OrbDescriber {
 public:
  static constexpr int kTurns = 64;
  static constexpr int kTests = 256;

  OrbDescriber();
  explicit OrbDescriber(std::span<const BinaryTest, kTests> tests);

  /// Of the patch around (x_px, y_px), at least 16 pixels inside `smoothed`. Bit i is test i.
  Descriptor describe(const LumaView& smoothed, int x_px, int y_px, float angle_deg) const;

 private:
  // Positions of a and b of each test in a patch of 32 bytes a row.
  using Turn = std::array<std::uint16_t, 2 * kTests>;
  std::vector<Turn> turns_;
};

}  // namespace loopd
