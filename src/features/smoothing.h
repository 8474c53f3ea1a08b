#pragma once

#include <cstdint>
#include <vector>

#include "features/simd.h"
#include "loopd/frame.h"

namespace loopd {

/// Smooths an image by 1 2 3 4 3 2 1 along rows and columns (two boxes of 4: close to a Gaussian
/// of 1.6 pixels, by additions alone, rounded once). Thread: one caller at a time.
class Smoothing {
 public:
  explicit Smoothing(SimdForm form = fastest_simd_form()) : form_(form) {}

  /// The smoothed `image`, of the same size, until the next call. Valid are the pixels at least
  /// `margin_px` (>= 3) inside it; the others are anything.
  LumaView smooth(const LumaView& image, int margin_px);

 private:
  SimdForm form_;
  std::vector<std::uint8_t> pixels_;
  std::vector<std::uint16_t> rows_;  // eight rows summed along x
};

}  // namespace loopd
