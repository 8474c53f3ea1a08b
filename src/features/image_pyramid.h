#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "features/simd.h"
#include "loopd/frame.h"

namespace loopd {

/// An image and its reductions, each `scale` times smaller than the one before, by bilinear
/// interpolation in integers (positions to 1/256 pixel, rounded to a grey level after each of the
/// two directions). Level 0 is the caller's image, not a copy. Memory is kept from image to image.
/// Thread: one caller at a time; the pixels of a built level may be read by any number, but level()
/// is a call as any other.
class ImagePyramid {
 public:
  /// Eight pixels of a row at once: which of 16 bytes from `base` on they are mixed of, as pairs.
  struct ColumnBlock {
    std::int32_t base = 0;
    std::array<std::uint8_t, 16> byte{};
    std::array<std::uint16_t, 8> weight{};  // of a pair's second byte, of 256
  };

  explicit ImagePyramid(SimdForm form = fastest_simd_form()) : form_(form) {}

  /// Starts on `image`, whose pixels must live as long as the levels are read: level 0 is there,
  /// the rest is not. `scale` in (1, 4], `levels` >= 1; no level is smaller than one pixel.
  void start(const LumaView& image, double scale, int levels);
  /// Builds the next level (after start: level 1), as long as built() < levels().
  void build_next();
  /// start() and all levels.
  void build(const LumaView& image, double scale, int levels);

  int levels() const { return levels_; }
  int built() const { return built_; }
  /// A level that is built; the levels above 0 have rows of a multiple of 32 bytes.
  LumaView level(int index) const;

 private:
  // Where the pixels of one axis come from: source `first` and the next one, weights of 256.
  struct Axis {
    std::vector<std::int32_t> first;
    std::vector<std::uint16_t> weight;  // of the next one
  };
  struct Level {
    int width_px = 0;
    int height_px = 0;
    int stride_bytes = 0;
    Axis columns;
    Axis rows;
    std::vector<ColumnBlock> blocks;  // empty if a block's pixels lie too far apart
    std::vector<std::uint8_t> pixels;
  };

  static void place(int from_px, int to_px, Axis& axis);
  static void gather_blocks(Level& level);
  void plan(int width_px, int height_px, double scale, int levels);

  SimdForm form_;
  LumaView image_;
  double scale_ = 0;
  int levels_ = 0;
  int built_ = 0;
  std::vector<Level> level_;
  std::vector<std::uint8_t> row_;
};

}  // namespace loopd
