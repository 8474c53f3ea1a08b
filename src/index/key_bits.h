#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "loopd/features.h"

namespace loopd {

/// Which bits of a descriptor make the keys of WordBuckets' hash tables.
///
/// Bits of real descriptors are correlated: 16 random ones give buckets 10-20 times fuller than
/// independent bits would. So the bits are chosen from a sample of the words themselves: balanced,
/// little correlated within a table, and spread over all tables. The choice is a function of the
/// sample alone. 2,000 words are enough: measured on ORB, bits chosen on one dataset serve another.
class KeyBits {
 public:
  static constexpr std::size_t kTables = 24;
  static constexpr std::size_t kMaxBits = 20;   ///< of a key; a table uses the first so many
  static constexpr std::size_t kSample = 2048;  ///< descriptors a choice looks at, at most

  using Keys = std::array<std::uint32_t, kTables>;

  /// What a choice computes with, so that it can be made where nothing may be allocated.
  struct Workspace {
    static constexpr std::size_t kBits = 256;
    static constexpr std::size_t kBlocks = kSample / kBits;
    using Costs = std::array<float, kBits>;

    std::array<std::array<Descriptor, kBits>, kBlocks> columns;  ///< bit i of 256 of the sample
    std::array<Costs, kBits> squared_correlation;
    std::array<Costs, kTables> cost;
  };

  KeyBits() = default;
  /// Chooses for the first kSample of `sample`, any content, not empty.
  /// Cost: 1-2 ms for kSample words.
  KeyBits(std::span<const Descriptor> sample, Workspace& workspace) noexcept;
  /// The same with a workspace of its own. Throws std::bad_alloc.
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
