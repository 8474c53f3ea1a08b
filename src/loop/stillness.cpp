#include "loop/stillness.h"

#include <algorithm>
#include <cmath>

#include "base/hamming.h"

namespace loopd {
namespace {

constexpr int kMaxDistance = 32;      // bits; noise flips fewer, another corner more
constexpr float kSearchRadius = 8;    // in units of still_radius_px
constexpr float kFinestPatchPx = 31;  // of a point on the finest pyramid level
constexpr double kMinFound = 0.15;    // of the poorer image's features; fewer tell nothing
constexpr float kCellPx = 16;
constexpr int kMaxCells = 512;  // along a side

// The last cell holds all that lies beyond it; no number (NaN) goes to the first.
int cell_index(float position_px, int cells) {
  const float cell = position_px / kCellPx;
  if (!(cell > 0)) return 0;
  return cell < static_cast<float>(cells) ? static_cast<int>(cell) : cells - 1;
}

int cells_of(int side_px) { return std::min(side_px / static_cast<int>(kCellPx) + 1, kMaxCells); }

struct Middle {
  float x = 0;
  float y = 0;
};
Middle middle(const Line& line) {
  return {(line.start_x_px + line.end_x_px) / 2, (line.start_y_px + line.end_y_px) / 2};
}

// How far `line` lies from the straight line through `old`: along the line, ends slide with noise.
float offset_across(const Line& old, const Line& line) {
  const float dx = old.end_x_px - old.start_x_px;
  const float dy = old.end_y_px - old.start_y_px;
  const float length = std::sqrt(dx * dx + dy * dy);
  const Middle m = middle(line);
  if (!(length > 0)) return kSearchRadius;
  return std::abs((m.x - old.start_x_px) * dy - (m.y - old.start_y_px) * dx) / length;
}

}  // namespace

bool StillnessTest::is_still(const Features& before, const Features& now) {
  if (before.width_px != now.width_px || before.height_px != now.height_px) return false;
  if (now.width_px < 1 || now.height_px < 1) return false;
  const Tally points = tally_points(before, now);
  const Tally lines = tally_lines(before, now);
  const auto poorer = static_cast<double>(
      std::min(before.points.size() + before.lines.size(), now.points.size() + now.lines.size()));
  const auto found = static_cast<double>(points.found + lines.found);
  const auto unmoved = static_cast<double>(points.unmoved + lines.unmoved);
  return found > 0 && found >= kMinFound * poorer && unmoved >= config_.still_fraction * found;
}

void StillnessTest::sort_into_cells(const Features& before) {
  columns_ = cells_of(before.width_px);
  rows_ = cells_of(before.height_px);
  const auto cells = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  const auto cell_of = [this](const Point& p) {
    return static_cast<std::size_t>(cell_index(p.y_px, rows_) * columns_ +
                                    cell_index(p.x_px, columns_));
  };
  // A counting sort: ends[c] becomes the end of cell c, then its start as the cell fills backwards.
  cell_start_.assign(cells + 1, 0);
  sorted_.resize(before.points.size());
  for (const Point& p : before.points) ++cell_start_[cell_of(p)];
  for (std::size_t c = 1; c <= cells; ++c) cell_start_[c] += cell_start_[c - 1];
  for (std::size_t i = before.points.size(); i-- > 0;)
    sorted_[--cell_start_[cell_of(before.points[i])]] = static_cast<std::uint32_t>(i);
}

StillnessTest::Tally StillnessTest::tally_points(const Features& before, const Features& now) {
  sort_into_cells(before);
  const auto still_radius = static_cast<float>(config_.still_radius_px);
  Tally tally;
  for (std::size_t i = 0; i < now.points.size(); ++i) {
    const Point& p = now.points[i];
    const float unmoved_px = still_radius * p.size_px / kFinestPatchPx;
    const float reach_px = kSearchRadius * unmoved_px;
    int best = kMaxDistance + 1;
    bool unmoved = false;
    const int last_row = cell_index(p.y_px + reach_px, rows_);
    for (int row = cell_index(p.y_px - reach_px, rows_); row <= last_row; ++row) {
      const auto first =
          static_cast<std::size_t>(row * columns_ + cell_index(p.x_px - reach_px, columns_));
      const auto last =
          static_cast<std::size_t>(row * columns_ + cell_index(p.x_px + reach_px, columns_));
      for (std::uint32_t k = cell_start_[first]; k < cell_start_[last + 1]; ++k) {
        const Point& old = before.points[sorted_[k]];
        const float dx = old.x_px - p.x_px;
        const float dy = old.y_px - p.y_px;
        if (dx * dx + dy * dy > reach_px * reach_px) continue;
        const int distance =
            hamming_distance(before.point_descriptors[sorted_[k]], now.point_descriptors[i]);
        if (distance >= best) continue;
        best = distance;
        unmoved = dx * dx + dy * dy <= unmoved_px * unmoved_px;
      }
    }
    if (best > kMaxDistance) continue;
    ++tally.found;
    tally.unmoved += unmoved ? 1 : 0;
  }
  return tally;
}

StillnessTest::Tally StillnessTest::tally_lines(const Features& before, const Features& now) const {
  const auto unmoved_px = static_cast<float>(config_.still_radius_px);
  const float reach_px = 2 * kSearchRadius * unmoved_px;
  Tally tally;
  for (std::size_t i = 0; i < now.lines.size(); ++i) {
    const Middle m = middle(now.lines[i]);
    int best = kMaxDistance + 1;
    bool unmoved = false;
    for (std::size_t k = 0; k < before.lines.size(); ++k) {
      const Middle old = middle(before.lines[k]);
      if (std::abs(old.x - m.x) > reach_px || std::abs(old.y - m.y) > reach_px) continue;
      const int distance = hamming_distance(before.line_descriptors[k], now.line_descriptors[i]);
      if (distance >= best) continue;
      best = distance;
      unmoved = offset_across(before.lines[k], now.lines[i]) <= unmoved_px;
    }
    if (best > kMaxDistance) continue;
    ++tally.found;
    tally.unmoved += unmoved ? 1 : 0;
  }
  return tally;
}

}  // namespace loopd
