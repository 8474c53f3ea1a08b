#include "index/key_bits.h"

#include <algorithm>
#include <cassert>

#include "base/hamming.h"

namespace loopd {
namespace {

constexpr std::size_t kBits = KeyBits::Workspace::kBits;
// Weights of the choice: a bit always set costs kImbalance, one already used by another table
// kUse, one fully correlated with a bit of the same table 1.
constexpr float kImbalance = 1.0F;
constexpr float kUse = 0.15F;
// Random part, so that tables that are otherwise equal differ; below every real difference.
constexpr float kJitter = 0.01F;

// kSpread[b]: the eight bits of b as eight bytes of 0 or 1, low bit in the low byte.
constexpr std::array<std::uint64_t, 256> kSpread = [] {
  std::array<std::uint64_t, 256> spread{};
  for (std::uint64_t byte = 0; byte < 256; ++byte)
    for (std::uint64_t i = 0; i < 8; ++i) spread[byte] |= ((byte >> i) & 1) << (8 * i);
  return spread;
}();

// SplitMix64 (Steele, Lea, Flood 2014): the next of a seeded sequence, as a float in [0, 1).
float next_random(std::uint64_t& state) {
  state += 0x9e3779b97f4a7c15u;
  std::uint64_t z = state;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return static_cast<float>((z ^ (z >> 31)) >> 40) * 0x1p-24F;
}

// How often each bit is set in a sample, and the squared correlation of each pair, in a workspace.
class BitStatistics {
 public:
  BitStatistics(std::span<const Descriptor> sample, KeyBits::Workspace& workspace)
      : workspace_(workspace), n_(static_cast<float>(sample.size())) {
    transpose(sample);
    for (std::size_t i = 0; i < kBits; ++i) {
      std::uint32_t set = 0;
      for (const auto& block : workspace_.columns)
        set += static_cast<std::uint32_t>(hamming_distance(block[i], Descriptor{}));
      set_[i] = static_cast<float>(set);
    }
    for (std::size_t i = 0; i < kBits; ++i) correlate(i);
  }

  float mean(std::size_t bit) const { return set_[bit] / n_; }

 private:
  void transpose(std::span<const Descriptor> sample) {
    for (auto& block : workspace_.columns) block.fill(Descriptor{});
    for (std::size_t s = 0; s < sample.size(); ++s)
      for (std::size_t bit = 0; bit < kBits; ++bit)
        workspace_.columns[s / kBits][bit].words[s % kBits / 64] |=
            ((sample[s].words[bit / 64] >> (bit % 64)) & 1) << (s % 64);
  }

  // Bit i with all bits up to i. Where two columns differ tells where both are set:
  // |a and b| = (|a| + |b| - |a xor b|) / 2.
  void correlate(std::size_t i) {
    std::array<std::uint32_t, kBits> differ{};
    std::array<std::uint16_t, kBits> in_block;
    for (const auto& block : workspace_.columns) {
      hamming_distances(block[i], std::span(block).first(i + 1), std::span(in_block).first(i + 1));
      for (std::size_t j = 0; j <= i; ++j) differ[j] += in_block[j];
    }
    auto& squared = workspace_.squared_correlation;
    for (std::size_t j = 0; j <= i; ++j)
      squared[i][j] = squared[j][i] =
          correlation(i, j, (set_[i] + set_[j] - static_cast<float>(differ[j])) / 2);
  }

  // A bit that never changes counts as fully correlated with all: it is the last to be chosen.
  float correlation(std::size_t i, std::size_t j, float both) const {
    const float variances = mean(i) * (1 - mean(i)) * mean(j) * (1 - mean(j));
    if (variances <= 0) return 1;
    const float covariance = both / n_ - mean(i) * mean(j);
    return covariance * covariance / variances;
  }

  KeyBits::Workspace& workspace_;
  const float n_;
  std::array<float, kBits> set_{};  // in how many of the sample
};

}  // namespace

KeyBits::KeyBits(std::span<const Descriptor> sample, Workspace& workspace) noexcept {
  assert(!sample.empty());
  sample = sample.first(std::min(sample.size(), kSample));
  const BitStatistics statistics(sample, workspace);
  // cost[table][bit]: what choosing `bit` next costs, but for how often it is used by now.
  auto& cost = workspace.cost;
  for (auto& of_table : cost)
    for (std::size_t bit = 0; bit < kBits; ++bit) {
      const float imbalance = 2 * statistics.mean(bit) - 1;
      of_table[bit] = kImbalance * imbalance * imbalance;
    }

  constexpr float kChosen = 1e9F;
  std::array<float, kBits> used{};
  std::uint64_t random = 1;
  for (auto& of_position : positions_)
    for (std::size_t table = 0; table < kTables; ++table) {
      std::size_t best = 0;
      float least = kChosen;
      for (std::size_t bit = 0; bit < kBits; ++bit) {
        const float total = cost[table][bit] + kUse * used[bit] + kJitter * next_random(random);
        if (total < least) {
          least = total;
          best = bit;
        }
      }
      of_position[table] = static_cast<std::uint8_t>(best);
      used[best] += 1;
      for (std::size_t bit = 0; bit < kBits; ++bit)
        cost[table][bit] += workspace.squared_correlation[best][bit];
      cost[table][best] = kChosen;
    }
}

KeyBits::KeyBits(std::span<const Descriptor> sample)
    : KeyBits(sample, *std::make_unique<Workspace>()) {}

KeyBits::Keys KeyBits::keys(const Descriptor& descriptor, std::size_t bits) const {
  assert(bits <= kMaxBits);
  std::array<std::uint8_t, kBits> flat;
  for (std::size_t byte = 0; byte < kBits / 8; ++byte) {
    const std::uint64_t spread = kSpread[(descriptor.words[byte / 8] >> (byte % 8 * 8)) & 0xff];
    for (std::size_t i = 0; i < 8; ++i)
      flat[byte * 8 + i] = static_cast<std::uint8_t>(spread >> (8 * i));
  }
  Keys keys{};
  for (std::size_t bit = 0; bit < bits; ++bit)
    for (std::size_t table = 0; table < kTables; ++table)
      keys[table] |= static_cast<std::uint32_t>(flat[positions_[bit][table]]) << bit;
  return keys;
}

}  // namespace loopd
