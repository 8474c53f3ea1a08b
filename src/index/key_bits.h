#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "loopd/features.h"

namespace loopd {

/// Which bits of a descriptor make the keys of WordTable's hash tables.
///
/// Bits of real descriptors are correlated: 16 random ones give buckets 10-20 times fuller than
/// independent bits would. So the bits are chosen from a sample of the words themselves: balanced,
/// little correlated within a table, and spread over all tables. The choice is a function of the
/// sample alone. 2,000 words are enough: measured on ORB, bits chosen on one dataset serve another.
class KeyBits {
 public:
  static constexpr std::size_t kTables = 24;
  static constexpr std::size_t kMaxBits = 20;  ///< of a key; a table uses the first so many

  using Keys = std::array<std::uint32_t, kTables>;

  KeyBits() = default;
  /// Chooses for `sample`, any content, not empty. Throws std::bad_alloc.
  /// Cost: about 256 * 128 * sample.size() / 64 popcounts, 2 ms for 2,000 words.
  explicit KeyBits(std::span<const Descriptor> sample);

  /// The first `bits` bits of `descriptor`'s key in every table. Precondition: bits <= kMaxBits.
  Keys keys(const Descriptor& descriptor, std::size_t bits) const;

  /// Bit number `bit` of `descriptor`'s key in `table`.
  bool bit(const Descriptor& descriptor, std::size_t table, std::size_t bit) const {
    const std::size_t at = positions_[bit][table];
    return ((descriptor.words[at / 64] >> (at % 64)) & 1) != 0;
  }

 private:
  std::array<std::array<std::uint8_t, kTables>, kMaxBits> positions_{};
};

}  // namespace loopd
