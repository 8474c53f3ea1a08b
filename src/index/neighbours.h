#pragma once

#include <cstdint>
#include <optional>

namespace loopd {

/// A word and its Hamming distance to a query, [0, 256] bits.
struct Neighbour {
  std::uint32_t word = 0;
  int distance_bits = 0;
  friend bool operator==(const Neighbour&, const Neighbour&) = default;
};

/// The two words nearest to a query, by (distance, id). `second` is set only if `first` is.
struct Neighbours {
  std::optional<Neighbour> first;
  std::optional<Neighbour> second;
  friend bool operator==(const Neighbours&, const Neighbours&) = default;
};

}  // namespace loopd
