#pragma once

#include <cstdint>
#include <span>

#include "base/hamming.h"
#include "index/neighbours.h"
#include "loopd/features.h"

namespace loopd {

/// The oracle of WordTable: the exact two nearest of `words`, ids counted from 0, ties by lower id.
/// Slow and obvious, for tests and benchmarks. Cost: words.size() distances.
inline Neighbours brute_force_two_nearest(const Descriptor& query,
                                          std::span<const Descriptor> words) {
  Neighbours nearest;
  for (std::uint32_t id = 0; id < words.size(); ++id) {
    const Neighbour seen{id, hamming_distance(query, words[id])};
    if (!nearest.first || seen.distance_bits < nearest.first->distance_bits) {
      nearest.second = nearest.first;
      nearest.first = seen;
    } else if (!nearest.second || seen.distance_bits < nearest.second->distance_bits) {
      nearest.second = seen;
    }
  }
  return nearest;
}

}  // namespace loopd
