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
/// Thread: one caller at a time; memory is kept from call to call.
class IslandBuilder {
 public:
  /// Eq. 4: score = sum of the images' scores / (n - m + 1), positions m..n inclusive; those not
  /// retrieved count 0. `islands` is replaced: best first, ties by older image.
  void build(std::span<const PlacedCandidate> candidates, std::uint32_t gap,
             std::vector<Island>& islands);

 private:
  struct Growing {
    std::uint32_t seed = 0;
    std::uint32_t first = 0;
    std::uint32_t last = 0;
    ImageId first_image = 0;
    ImageId last_image = 0;
    PlacedCandidate best;  // the first to join, since candidates come best first
    std::uint32_t images = 0;
    double sum = 0;
  };
  void seed(std::span<const PlacedCandidate> candidates, std::uint32_t gap);
  static void join(Growing& island, const PlacedCandidate& c);

  std::vector<Growing> growing_;
};

/// Moves the islands that overlap `priority` (the island of the previous image, if its loop was
/// verified) to the front; the order is otherwise kept.
void prefer_island(std::vector<Island>& islands, const std::optional<Island>& priority);

}  // namespace loopd
