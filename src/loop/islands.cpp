#include "loop/islands.h"

#include <algorithm>

namespace loopd {
namespace {

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

std::uint32_t distance(std::uint32_t a, std::uint32_t b) { return a < b ? b - a : a - b; }

std::vector<Growing> seed_islands(std::span<const PlacedCandidate> candidates, std::uint32_t gap) {
  std::vector<Growing> islands;
  for (const PlacedCandidate& c : candidates) {
    const bool covered = std::any_of(islands.begin(), islands.end(), [&](const Growing& island) {
      return distance(island.seed, c.position) <= gap;
    });
    if (!covered)
      islands.push_back({c.position, c.position, c.position, c.image, c.image, c, 0, 0.0});
  }
  return islands;
}

void join(Growing& island, const PlacedCandidate& c) {
  if (c.position <= island.first) {
    island.first = c.position;
    island.first_image = c.image;
  }
  if (c.position >= island.last) {
    island.last = c.position;
    island.last_image = c.image;
  }
  if (island.images++ == 0) island.best = c;
  island.sum += c.score;
}

bool overlap(const Island& a, const Island& b) { return a.first <= b.last && b.first <= a.last; }

}  // namespace

std::vector<Island> build_islands(std::span<const PlacedCandidate> candidates, std::uint32_t gap) {
  std::vector<Growing> growing = seed_islands(candidates, gap);
  for (const PlacedCandidate& c : candidates) {
    const auto nearest =
        std::min_element(growing.begin(), growing.end(), [&](const Growing& a, const Growing& b) {
          return distance(a.seed, c.position) < distance(b.seed, c.position);
        });
    join(*nearest, c);
  }
  std::vector<Island> islands;
  for (const Growing& g : growing) {
    const double images = static_cast<double>(g.last - g.first) + 1;
    islands.push_back({g.first_image, g.last_image, g.best.image, g.sum / images});  // Equation (4)
  }
  std::sort(islands.begin(), islands.end(), [](const Island& a, const Island& b) {
    return a.score != b.score ? a.score > b.score : a.first < b.first;
  });
  return islands;
}

void prefer_island(std::vector<Island>& islands, const std::optional<Island>& priority) {
  if (!priority) return;
  std::stable_partition(islands.begin(), islands.end(),
                        [&](const Island& island) { return overlap(island, *priority); });
}

}  // namespace loopd
