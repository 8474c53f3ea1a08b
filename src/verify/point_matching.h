#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "loopd/config.h"
#include "loopd/features.h"
#include "verify/distance_rows.h"
#include "verify/matches.h"

namespace loopd {

/// Matches binary descriptors of two images by nearest neighbours, distance ratio and mutual check.
/// Holds only scratch memory; allocates nothing once it has seen the largest sizes.
/// Thread: one caller at a time.
class PointMatcher {
 public:
  /// Fills `matches` (cleared first), ordered by query index. A query point is matched with its
  /// nearest candidate point (ties: lower index) if the distance is at most `max_point_distance`,
  /// the ratio to its second neighbour at most `point_ratio` (see nndr()), and no query point is
  /// nearer to that candidate; of several equally near the lowest index has it.
  /// Precondition: both sizes below 65536. Cost: each distance once; 1500 x 1500 in about 4 ms.
  void match(std::span<const Descriptor> query, std::span<const Descriptor> candidate,
             const VerifyConfig& config, std::vector<FeatureMatch>& matches);

 private:
  DistanceRows rows_;
  std::vector<bool> used_;
};

}  // namespace loopd
