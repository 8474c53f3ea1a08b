#include "verify/point_matching.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <optional>

#include "base/hamming.h"

namespace loopd {
namespace {

// Signed 16-bit minima are one instruction on every CPU of interest, and distances stay below 257.
constexpr std::size_t kLanes = 16;
constexpr std::int16_t kFar = 0x7fff;

struct BestTwo {
  std::int16_t first = kFar;
  std::int16_t second = kFar;

  void add(std::int16_t d) {
    second = std::min(second, std::max(first, d));
    first = std::min(first, d);
  }
};

// The two smallest distances of a row; lowers `column_best` by the row on the way.
BestTwo scan_row(std::span<const std::uint16_t> row, std::span<std::uint16_t> column_best) {
  std::array<std::int16_t, kLanes> first, second;
  first.fill(kFar);
  second.fill(kFar);
  std::size_t j = 0;
  for (; j + kLanes <= row.size(); j += kLanes)
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const auto d = static_cast<std::int16_t>(row[j + lane]);
      const auto column = static_cast<std::int16_t>(column_best[j + lane]);
      second[lane] = std::min(second[lane], std::max(first[lane], d));
      first[lane] = std::min(first[lane], d);
      column_best[j + lane] = static_cast<std::uint16_t>(std::min(column, d));
    }
  BestTwo best;
  for (; j < row.size(); ++j) {
    best.add(static_cast<std::int16_t>(row[j]));
    column_best[j] = std::min(column_best[j], row[j]);
  }
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    best.add(first[lane]);
    best.add(second[lane]);
  }
  return best;
}

}  // namespace

void PointMatcher::match(std::span<const Descriptor> query, std::span<const Descriptor> candidate,
                         const VerifyConfig& config, std::vector<FeatureMatch>& matches) {
  assert(query.size() < 65536 && candidate.size() < 65536);
  matches.clear();
  if (candidate.empty()) return;
  row_.resize(candidate.size());
  nearest_query_distance_.assign(candidate.size(), static_cast<std::uint16_t>(kFar));

  for (std::size_t i = 0; i < query.size(); ++i) {
    hamming_distances(query[i], candidate, row_);
    const BestTwo best = scan_row(row_, nearest_query_distance_);
    const auto second = best.second == kFar ? std::nullopt : std::optional<int>(best.second);
    const auto ratio = nndr(best.first, second, config.point_ratio, config.max_point_distance);
    if (!ratio) continue;
    const auto nearest = std::find(row_.begin(), row_.end(), best.first) - row_.begin();
    matches.push_back({static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(nearest),
                       static_cast<std::uint16_t>(best.first), *ratio});
  }

  used_.assign(candidate.size(), false);
  std::erase_if(matches, [&](const FeatureMatch& m) {
    if (m.distance != nearest_query_distance_[m.candidate] || used_[m.candidate]) return true;
    used_[m.candidate] = true;
    return false;
  });
}

}  // namespace loopd
