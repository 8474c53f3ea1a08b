#include "loop/islands.h"

#include <algorithm>

namespace loopd {
namespace {

std::uint32_t distance(std::uint32_t a, std::uint32_t b) { return a < b ? b - a : a - b; }

bool overlap(const Island& a, const Island& b) { return a.first <= b.last && b.first <= a.last; }

}  // namespace

void IslandBuilder::seed(std::span<const PlacedCandidate> candidates, std::uint32_t gap) {
  growing_.clear();
  for (const PlacedCandidate& c : candidates) {
    const bool covered = std::any_of(growing_.begin(), growing_.end(), [&](const Growing& island) {
      return distance(island.seed, c.position) <= gap;
    });
    if (!covered)
      growing_.push_back({c.position, c.position, c.position, c.image, c.image, c, 0, 0.0});
  }
}

void IslandBuilder::join(Growing& island, const PlacedCandidate& c) {
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

void IslandBuilder::build(std::span<const PlacedCandidate> candidates, std::uint32_t gap,
                          std::vector<Island>& islands) {
  seed(candidates, gap);
  for (const PlacedCandidate& c : candidates)
    join(*std::min_element(growing_.begin(), growing_.end(),
                           [&](const Growing& a, const Growing& b) {
                             return distance(a.seed, c.position) < distance(b.seed, c.position);
                           }),
         c);
  islands.clear();
  for (const Growing& g : growing_) {
    const double images = static_cast<double>(g.last - g.first) + 1;
    islands.push_back({g.first_image, g.last_image, g.best.image, g.sum / images});  // Equation (4)
  }
  std::sort(islands.begin(), islands.end(), [](const Island& a, const Island& b) {
    return a.score != b.score ? a.score > b.score : a.first < b.first;
  });
}

void prefer_island(std::vector<Island>& islands, const std::optional<Island>& priority) {
  if (!priority) return;
  auto front = islands.begin();
  for (auto island = front; island != islands.end(); ++island)
    if (overlap(*island, *priority)) std::rotate(front++, island, island + 1);
}

}  // namespace loopd
