#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "loopd/report.h"

namespace loopd {

/// A candidate with its position among the searchable images (eviction leaves no holes there).
struct PlacedCandidate {
  ImageId image = 0;
  std::uint32_t position = 0;
  double score = 0;
};

/// Groups candidates (best first) into islands: the best ungrouped candidate seeds an island, and
/// every candidate joins the seed nearest to it, if that is within `gap` positions (ties: the
/// better seed). Thus islands never overlap and an island holds at most 2 * gap + 1 images.
/// Eq. 4: score = sum of the images' scores / (n - m + 1), positions m..n inclusive; those not
/// retrieved count 0. Best island first, ties by older image.
std::vector<Island> build_islands(std::span<const PlacedCandidate> candidates, std::uint32_t gap);

/// Moves the islands that overlap `priority` (the island of the previous image, if its loop was
/// verified) to the front; the order is otherwise kept.
void prefer_island(std::vector<Island>& islands, const std::optional<Island>& priority);

}  // namespace loopd
