#include "loop/stillness.h"

#include <algorithm>
#include <cmath>

#include "base/hamming.h"

namespace loopd {
namespace {

constexpr int kMaxDistance = 64;  // bits; noise flips fewer, another corner more
constexpr float kCellPx = 16;

struct Grid {
  int columns = 1;
  int rows = 1;
  std::size_t cells() const {
    return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  }
  int column(float x) const { return std::clamp(static_cast<int>(x / kCellPx), 0, columns - 1); }
  int row(float y) const { return std::clamp(static_cast<int>(y / kCellPx), 0, rows - 1); }
  std::size_t cell(int column_index, int row_index) const {
    return static_cast<std::size_t>(row_index) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(column_index);
  }
};

bool line_unmoved(const Line& a, const Line& b, float radius) {
  const auto near = [radius](float p, float q) { return std::abs(p - q) <= radius; };
  // End points slide along a line with noise; a line stays if its middle and direction do.
  const float tolerance = 4 * radius;
  return near((a.start_x_px + a.end_x_px) / 2, (b.start_x_px + b.end_x_px) / 2) &&
         near((a.start_y_px + a.end_y_px) / 2, (b.start_y_px + b.end_y_px) / 2) &&
         std::abs(a.start_x_px - b.start_x_px) <= tolerance &&
         std::abs(a.start_y_px - b.start_y_px) <= tolerance;
}

std::size_t unmoved_lines(const Features& before, const Features& now, float radius) {
  return static_cast<std::size_t>(
      std::count_if(now.lines.begin(), now.lines.end(), [&](const Line& line) {
        return std::any_of(before.lines.begin(), before.lines.end(),
                           [&](const Line& old) { return line_unmoved(line, old, radius); });
      }));
}

}  // namespace

double StillnessTest::share_unmoved(const Features& before, const Features& now) {
  if (before.width_px != now.width_px || before.height_px != now.height_px) return 0;
  const std::size_t poorer =
      std::min(before.points.size() + before.lines.size(), now.points.size() + now.lines.size());
  if (poorer == 0) return 0;
  const auto radius =
      std::max(1.5F, static_cast<float>(config_.still_radius) * static_cast<float>(now.width_px));
  const Grid grid{static_cast<int>(static_cast<float>(now.width_px) / kCellPx) + 1,
                  static_cast<int>(static_cast<float>(now.height_px) / kCellPx) + 1};

  // Counting sort of the old points by cell.
  cell_start_.assign(grid.cells() + 1, 0);
  sorted_.resize(before.points.size());
  const auto cell_of = [&](const Point& p) {
    return grid.cell(grid.column(p.x_px), grid.row(p.y_px));
  };
  for (const Point& p : before.points) ++cell_start_[cell_of(p) + 1];
  for (std::size_t i = 1; i < cell_start_.size(); ++i) cell_start_[i] += cell_start_[i - 1];
  std::vector<std::uint32_t> next(cell_start_.begin(), cell_start_.end() - 1);
  for (std::uint32_t i = 0; i < before.points.size(); ++i)
    sorted_[next[cell_of(before.points[i])]++] = i;

  const auto unmoved = [&](std::size_t i) {
    const Point& p = now.points[i];
    for (int row = grid.row(p.y_px - radius); row <= grid.row(p.y_px + radius); ++row) {
      const std::size_t first = grid.cell(grid.column(p.x_px - radius), row);
      const std::size_t last = grid.cell(grid.column(p.x_px + radius), row);
      for (std::uint32_t k = cell_start_[first]; k < cell_start_[last + 1]; ++k) {
        const Point& old = before.points[sorted_[k]];
        const float dx = old.x_px - p.x_px;
        const float dy = old.y_px - p.y_px;
        if (dx * dx + dy * dy <= radius * radius &&
            hamming_distance(before.point_descriptors[sorted_[k]], now.point_descriptors[i]) <=
                kMaxDistance)
          return true;
      }
    }
    return false;
  };
  std::size_t stayed = unmoved_lines(before, now, radius);
  for (std::size_t i = 0; i < now.points.size(); ++i) stayed += unmoved(i) ? 1 : 0;
  return std::min(1.0, static_cast<double>(stayed) / static_cast<double>(poorer));
}

}  // namespace loopd
