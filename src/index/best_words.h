#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "index/neighbours.h"

namespace loopd {

/// The kSize nearest of the words offered, by (distance, id), each remembered as opened or not:
/// what a best-first search keeps (the same word offered twice counts once).
class BestWords {
 public:
  static constexpr std::size_t kSize = 16;

  BestWords() { keys_.fill(kNothing); }

  /// What is farther is not kept, bits.
  std::uint16_t bound() const { return bound_; }

  void offer(std::uint32_t id, std::uint16_t distance_bits) {
    const std::uint64_t key = (std::uint64_t{distance_bits} << kDistanceAt) | std::uint64_t{id}
                                                                                  << 1;
    if (key >= keys_.back()) return;
    std::size_t at = kSize - 1;
    while (at > 0 && key < keys_[at - 1]) --at;
    if (at > 0 && (keys_[at - 1] | kOpened) == (key | kOpened)) return;
    if ((keys_[at] | kOpened) == (key | kOpened)) return;
    for (std::size_t i = kSize - 1; i > at; --i) keys_[i] = keys_[i - 1];
    keys_[at] = key;
    if (keys_.back() != kNothing) bound_ = static_cast<std::uint16_t>(keys_.back() >> kDistanceAt);
  }

  /// The nearest few that were not opened before, into `ids`; returns how many. They are now.
  template <std::size_t N>
  std::size_t open(std::array<std::uint32_t, N>& ids) {
    std::size_t opened = 0;
    for (std::uint64_t& key : keys_) {
      if (opened == N || key == kNothing) break;
      if ((key & kOpened) != 0) continue;
      key |= kOpened;
      ids[opened++] = id_of(key);
    }
    return opened;
  }

  /// All, nearest first, into `ids`; returns how many.
  std::size_t ids(std::array<std::uint32_t, kSize>& ids) const {
    std::size_t count = 0;
    while (count < kSize && keys_[count] != kNothing) {
      ids[count] = id_of(keys_[count]);
      ++count;
    }
    return count;
  }

  Neighbours two_nearest() const { return {neighbour(keys_[0]), neighbour(keys_[1])}; }

 private:
  // Distance above, id below, the lowest bit tells whether it was opened.
  static constexpr std::uint64_t kNothing = ~std::uint64_t{0};
  static constexpr std::uint64_t kOpened = 1;
  static constexpr int kDistanceAt = 33;

  static std::uint32_t id_of(std::uint64_t key) { return static_cast<std::uint32_t>(key >> 1U); }
  static std::optional<Neighbour> neighbour(std::uint64_t key) {
    if (key == kNothing) return std::nullopt;
    return Neighbour{id_of(key), static_cast<int>(key >> kDistanceAt)};
  }

  std::array<std::uint64_t, kSize> keys_;
  std::uint16_t bound_ = 256;
};

}  // namespace loopd
