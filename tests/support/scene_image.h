#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include "loopd/frame.h"

namespace loopd::testing {

/// A small 8-bit image that owns its pixels.
struct Image {
  int width_px = 0;
  int height_px = 0;
  std::vector<std::uint8_t> pixels;

  Image(int width, int height, std::uint8_t grey = 0)
      : width_px(width),
        height_px(height),
        pixels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), grey) {}
  std::uint8_t& at(int x, int y) {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
                  static_cast<std::size_t>(x)];
  }
  std::uint8_t at(int x, int y) const { return const_cast<Image*>(this)->at(x, y); }
  LumaView view() const { return {pixels.data(), width_px, height_px, width_px}; }
  Frame frame(std::uint64_t sequence, std::optional<std::int64_t> time_ns = std::nullopt) const {
    return copy_to_frame(view(), sequence, time_ns);
  }
  void fill(int x0, int y0, int x1, int y1, std::uint8_t grey) {
    for (int y = std::max(0, y0); y < std::min(height_px, y1); ++y)
      for (int x = std::max(0, x0); x < std::min(width_px, x1); ++x) at(x, y) = grey;
  }
};

/// A wall full of random rectangles, seen through a window `offset` pixels along it: images of the
/// same seed with nearby offsets overlap, those of other seeds share nothing.
inline Image wall_image(unsigned seed, int offset_px = 0, int width = 320, int height = 240) {
  std::mt19937 random(seed);
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  Image image(width, height, 128);
  for (int i = 0; i < 400; ++i) {
    const int x = below(4 * width) - width - offset_px;
    const int y = below(height);
    const int w = 6 + below(60);
    const int h = 6 + below(60);
    image.fill(x, y, x + w, y + h, static_cast<std::uint8_t>(below(256)));
  }
  return image;
}

/// `image` with noise of about `sigma` grey levels (sum of uniform steps), the same for a seed.
inline Image with_noise(Image image, double sigma, unsigned seed) {
  std::mt19937 random(seed);
  for (std::uint8_t& pixel : image.pixels) {
    int sum = 0;
    for (int i = 0; i < 4; ++i) sum += static_cast<int>(random() % 256U);
    const double noise = (sum - 510) * sigma / 147.8;  // four uniform bytes: sigma 147.8
    pixel = static_cast<std::uint8_t>(std::clamp(static_cast<int>(pixel + noise), 0, 255));
  }
  return image;
}

}  // namespace loopd::testing
