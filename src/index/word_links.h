#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "loopd/features.h"

namespace loopd {

/// What WordTable knows of one word beside its descriptor, in one cache line: its links to words
/// near it. A new word links to the nearest found when it came, and they back to it where it is
/// nearer than one of theirs: a small navigable graph (after Malkov et al. 2014) on which a look-up
/// goes on from what the hash tables found.
///
/// A link to a word that was erased since, or whose id was given away, may stay: it leads to a word
/// all the same, or is seen to be dead.
class alignas(64) WordLinks {
 public:
  static constexpr std::size_t kLinks = 12;
  static constexpr std::uint32_t kNone = 0xffffffff;

  std::span<const std::uint32_t, kLinks> ids() const { return ids_; }

  /// Forgets all links.
  void clear() {
    ids_.fill(kNone);
    distances_.fill(kUnlinked);
  }

  /// Room for the id freed before, for a list of free ids; while this word is none.
  void set_next_free(std::uint32_t id) { ids_[0] = id; }
  std::uint32_t next_free() const { return ids_[0]; }

  /// Links to word `id`, not linked yet, if it is nearer than the farthest or there is room.
  void link(std::uint32_t id, int distance_bits) {
    const auto farthest = std::max_element(distances_.begin(), distances_.end());
    const auto distance = static_cast<std::uint8_t>(std::min<int>(distance_bits, kUnlinked - 1));
    if (distance >= *farthest) return;
    *farthest = distance;
    ids_[static_cast<std::size_t>(farthest - distances_.begin())] = id;
  }

  void unlink(std::uint32_t id) {
    for (std::size_t i = 0; i < kLinks; ++i) {
      if (ids_[i] != id) continue;
      ids_[i] = kNone;
      distances_[i] = kUnlinked;
    }
  }

 private:
  static constexpr std::uint8_t kUnlinked = 255;

  std::array<std::uint32_t, kLinks> ids_;
  std::array<std::uint8_t, kLinks> distances_;  // bits, as they were when linked
};
static_assert(sizeof(WordLinks) == 64);

}  // namespace loopd
