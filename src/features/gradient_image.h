#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "loopd/frame.h"

namespace loopd {

/// Image gradient by the 5x5 Sobel kernel (the derivative 1 2 0 -2 -1 across the smoothing 1 4 6 4
/// 1: a 3x3 Sobel of the binomially smoothed image), x and y side by side so that one read brings
/// both. Row y starts at `y * width_px`.
struct GradientImage {
  struct Gradient {
    std::int16_t x = 0;
    std::int16_t y = 0;
  };
  static constexpr int kBorderPx = 2;     ///< at the image's sides, where the gradient is zero
  static constexpr int kUnit = 128;       ///< of a slope of one grey level a pixel
  static constexpr int kLargest = 12240;  ///< of either component, at a step of 255

  std::vector<Gradient> pixels;
  int width_px = 0;
  int height_px = 0;

  /// Replaces the content by the gradient of `image`; an image without an inside has none.
  /// Allocates only when the image is larger than all before.
  void compute(const LumaView& image);
  const Gradient* row(int y) const {
    return pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px);
  }
  const Gradient& at(int x, int y) const { return row(y)[x]; }

 private:
  std::vector<std::int16_t> smooth_;      // of one row: 1 4 6 4 1 down the column
  std::vector<std::int16_t> difference_;  // of one row: -1 -2 0 2 1 down the column
};

}  // namespace loopd
