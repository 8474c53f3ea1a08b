#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace loopd {

/// A 256-bit binary descriptor (ORB of a point, LBD of a line). Bit i is bit i % 64 of
/// words[i / 64]; the first byte of the field's usual byte order is the low byte of words[0].
struct alignas(32) Descriptor {
  std::array<std::uint64_t, 4> words{};
  friend bool operator==(const Descriptor&, const Descriptor&) = default;
};

/// An image point in raw full-resolution pixels.
struct Point {
  float x_px = 0;
  float y_px = 0;
  float size_px = 0;    ///< diameter of the described patch; grows with the pyramid level
  float angle_deg = 0;  ///< orientation, [0, 360), clockwise on the screen (x towards y)
};

/// A directed line segment in raw full-resolution pixels. Its direction is fixed by contrast:
/// walking from start to end on the screen, the darker side is always on the same hand, so a line
/// seen again in a rotated view keeps its direction relative to the scene.
struct Line {
  float start_x_px = 0;
  float start_y_px = 0;
  float end_x_px = 0;
  float end_y_px = 0;
};

/// What one image shows: points and lines, each with its descriptors (same index, same length).
struct Features {
  std::vector<Point> points;
  std::vector<Descriptor> point_descriptors;
  std::vector<Line> lines;
  std::vector<Descriptor> line_descriptors;
  int width_px = 0;  ///< of the full-resolution image they were found in
  int height_px = 0;

  void clear();
  /// Bytes on the heap, by capacity.
  std::size_t bytes() const;
};

}  // namespace loopd
