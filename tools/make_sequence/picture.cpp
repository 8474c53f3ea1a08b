#include "make_sequence/picture.h"

#include <algorithm>
#include <cmath>

namespace loopd::sequence {

Canvas::Canvas(int width, int height, int grey)
    : width_(width),
      height_(height),
      pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
              static_cast<std::uint8_t>(std::clamp(grey, 0, 255))) {}

void Canvas::set(int x, int y, int grey) {
  if (x < 0 || y < 0 || x >= width_ || y >= height_) return;
  pixels_[index(x, y)] = static_cast<std::uint8_t>(std::clamp(grey, 0, 255));
}

void Canvas::rect(int x0, int y0, int x1, int y1, int grey) {
  for (int y = std::max(y0, 0); y < std::min(y1, height_); ++y) {
    for (int x = std::max(x0, 0); x < std::min(x1, width_); ++x) set(x, y, grey);
  }
}

void Canvas::outline(int x0, int y0, int x1, int y1, int thickness, int grey) {
  rect(x0, y0, x1, y0 + thickness, grey);
  rect(x0, y1 - thickness, x1, y1, grey);
  rect(x0, y0, x0 + thickness, y1, grey);
  rect(x1 - thickness, y0, x1, y1, grey);
}

void Canvas::disc(double cx, double cy, double radius, int grey) {
  for (int y = static_cast<int>(cy - radius); y <= static_cast<int>(cy + radius) + 1; ++y) {
    for (int x = static_cast<int>(cx - radius); x <= static_cast<int>(cx + radius) + 1; ++x) {
      const double dx = x + 0.5 - cx;
      const double dy = y + 0.5 - cy;
      if (dx * dx + dy * dy <= radius * radius) set(x, y, grey);
    }
  }
}

void Canvas::triangle(const double (&x)[3], const double (&y)[3], int grey) {
  const int top = static_cast<int>(std::min({y[0], y[1], y[2]}));
  const int bottom = static_cast<int>(std::max({y[0], y[1], y[2]})) + 1;
  const int left = static_cast<int>(std::min({x[0], x[1], x[2]}));
  const int right = static_cast<int>(std::max({x[0], x[1], x[2]})) + 1;
  const auto side = [&](int i, int j, double px, double py) {
    return (x[j] - x[i]) * (py - y[i]) - (y[j] - y[i]) * (px - x[i]);
  };
  for (int py = top; py <= bottom; ++py) {
    for (int px = left; px <= right; ++px) {
      const double a = side(0, 1, px + 0.5, py + 0.5);
      const double b = side(1, 2, px + 0.5, py + 0.5);
      const double c = side(2, 0, px + 0.5, py + 0.5);
      if ((a >= 0 && b >= 0 && c >= 0) || (a <= 0 && b <= 0 && c <= 0)) set(px, py, grey);
    }
  }
}

void Canvas::stroke(double x0, double y0, double x1, double y1, double thickness, int grey) {
  const double length = std::sqrt((x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0));
  const int steps = static_cast<int>(length * 2) + 1;
  for (int i = 0; i <= steps; ++i) {
    const double f = static_cast<double>(i) / steps;
    disc(x0 + f * (x1 - x0), y0 + f * (y1 - y0), thickness / 2, grey);
  }
}

Picture::Picture(const Canvas& canvas)
    : width_(canvas.width()),
      height_(canvas.height()),
      sums_(static_cast<std::size_t>(width_ + 1) * static_cast<std::size_t>(height_ + 1), 0) {
  const std::size_t row = static_cast<std::size_t>(width_) + 1;
  for (int y = 0; y < height_; ++y) {
    std::uint32_t line = 0;
    const std::size_t above = static_cast<std::size_t>(y) * row;
    for (int x = 0; x < width_; ++x) {
      line += canvas.at(x, y);
      const std::size_t i = static_cast<std::size_t>(x) + 1;
      sums_[above + row + i] = sums_[above + i] + line;
    }
  }
}

double Picture::sum(double x, double y) const {
  const int xi = std::min(static_cast<int>(x), width_ - 1);
  const int yi = std::min(static_cast<int>(y), height_ - 1);
  const double fx = x - xi;
  const double fy = y - yi;
  const std::size_t row = static_cast<std::size_t>(width_) + 1;
  const std::uint32_t* s =
      &sums_[static_cast<std::size_t>(yi) * row + static_cast<std::size_t>(xi)];
  const double top = s[0] + fx * (static_cast<double>(s[1]) - s[0]);
  const double bottom = s[row] + fx * (static_cast<double>(s[row + 1]) - s[row]);
  return top + fy * (bottom - top);
}

double Picture::mean(double x0, double y0, double x1, double y1) const {
  // A thousandth of a texel is the least box, so that the quotient below is always defined.
  constexpr double kLeast = 1e-3;
  x0 = std::clamp(x0, 0.0, width_ - kLeast);
  x1 = std::clamp(x1, x0 + kLeast, static_cast<double>(width_));
  y0 = std::clamp(y0, 0.0, height_ - kLeast);
  y1 = std::clamp(y1, y0 + kLeast, static_cast<double>(height_));
  const double area = (x1 - x0) * (y1 - y0);
  return (sum(x1, y1) - sum(x0, y1) - sum(x1, y0) + sum(x0, y0)) / area;
}

}  // namespace loopd::sequence
