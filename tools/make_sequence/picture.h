#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace loopd::sequence {

/// A small grey drawing surface, row 0 at the top. Drawing outside is clipped.
class Canvas {
 public:
  Canvas(int width, int height, int grey);
  int width() const { return width_; }
  int height() const { return height_; }
  std::uint8_t at(int x, int y) const { return pixels_[index(x, y)]; }

  void set(int x, int y, int grey);
  /// Pixels x0 <= x < x1, y0 <= y < y1.
  void rect(int x0, int y0, int x1, int y1, int grey);
  void outline(int x0, int y0, int x1, int y1, int thickness, int grey);
  void disc(double cx, double cy, double radius, int grey);
  void triangle(const double (&x)[3], const double (&y)[3], int grey);
  void stroke(double x0, double y0, double x1, double y1, double thickness, int grey);

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  int width_;
  int height_;
  std::vector<std::uint8_t> pixels_;
};

/// A canvas as a summed-area table: the mean over any axis-parallel box in constant time, which is
/// an exact antialiasing filter for pictures on walls. Immutable.
class Picture {
 public:
  explicit Picture(const Canvas& canvas);
  int width() const { return width_; }
  int height() const { return height_; }
  /// Mean grey over the box [x0, x1] x [y0, y1] in texels (texel i covers [i, i + 1]), clipped to
  /// the picture; an empty box is taken for a thousandth of a texel.
  double mean(double x0, double y0, double x1, double y1) const;

 private:
  double sum(double x, double y) const;
  int width_;
  int height_;
  std::vector<std::uint32_t> sums_;  // (height + 1) rows of (width + 1)
};

}  // namespace loopd::sequence
