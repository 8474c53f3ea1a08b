#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "loopd/features.h"
#include "loopd/frame.h"

namespace loopd {

/// Image gradient (Sobel 3x3 of the lightly smoothed image), x and y side by side so that one read
/// brings both. Row y starts at `(y * width_px)`.
struct GradientImage {
  struct Gradient {
    std::int16_t x = 0;
    std::int16_t y = 0;
  };
  std::vector<Gradient> pixels;
  int width_px = 0;
  int height_px = 0;

  /// Replaces the content by the gradient of `image`; zero at the image's border.
  /// Throws cv::Exception.
  void compute(const LumaView& image);
  const Gradient& at(int x, int y) const {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
                  static_cast<std::size_t>(x)];
  }

 private:
  std::vector<std::uint8_t> smooth_;
};

/// Turns each line so that the gradient across it points to its left when walking from start to
/// end on the screen (the darker side is on the right-hand side).
void direct_by_contrast(const GradientImage& gradient, std::span<Line> lines);

/// Binary Line Band Descriptor (Zhang and Koch 2013; its 256-bit form as in the paper, section
/// 2.1.2): 9 bands of 7 px along the line; mean and deviation of the gradient's four half-sums in
/// each band and its neighbours; 32 pairs of bands compared value by value, 8 bits a pair.
/// Only differences decide a bit, so the float form's normalisation is not needed.
/// Line coordinates are pixels of the gradient image; any are answered (clamped to the image).
void describe_lines(const GradientImage& gradient, std::span<const Line> lines,
                    std::span<Descriptor> descriptors);

}  // namespace loopd
