#include "verify/point_matching.h"

#include <algorithm>
#include <cassert>
#include <optional>

namespace loopd {
void PointMatcher::match(std::span<const Descriptor> query, std::span<const Descriptor> candidate,
                         const VerifyConfig& config, std::vector<FeatureMatch>& matches) {
  assert(query.size() < 65536 && candidate.size() < 65536);
  matches.clear();
  if (candidate.empty()) return;
  rows_.assign(candidate);

  for (std::size_t i = 0; i < query.size(); ++i) {
    const auto best = rows_.compute(query[i]);
    const auto second =
        best.second == DistanceRows::kFar ? std::nullopt : std::optional<int>(best.second);
    const auto ratio = nndr(best.first, second, config.point_ratio, config.max_point_distance);
    if (!ratio) continue;
    const auto row = rows_.row();
    const auto nearest = std::find(row.begin(), row.end(), best.first) - row.begin();
    matches.push_back(
        {static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(nearest), best.first, *ratio});
  }

  used_.assign(candidate.size(), false);
  std::erase_if(matches, [&](const FeatureMatch& m) {
    if (m.distance != rows_.column_best()[m.candidate] || used_[m.candidate]) return true;
    used_[m.candidate] = true;
    return false;
  });
}

}  // namespace loopd
