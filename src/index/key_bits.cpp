#include "index/key_bits.h"

#include <bit>
#include <cassert>
#include <cstring>
#include <vector>

namespace loopd {
namespace {

constexpr std::size_t kBits = 256;
// Weights of the choice: a bit always set costs kImbalance, one already used by another table
// kUse, one fully correlated with a bit of the same table 1.
constexpr double kImbalance = 1.0;
constexpr double kUse = 0.15;
// Random part, so that tables that are otherwise equal differ; below every real difference.
constexpr double kJitter = 0.01;

// kSpread[b]: the eight bits of b as eight bytes of 0 or 1, low bit in the low byte.
constexpr std::array<std::uint64_t, 256> kSpread = [] {
  std::array<std::uint64_t, 256> spread{};
  for (std::uint64_t byte = 0; byte < 256; ++byte)
    for (std::uint64_t i = 0; i < 8; ++i) spread[byte] |= ((byte >> i) & 1) << (8 * i);
  return spread;
}();

// SplitMix64 (Steele, Lea, Flood 2014): the next of a seeded sequence, as a double in [0, 1).
double next_random(std::uint64_t& state) {
  state += 0x9e3779b97f4a7c15u;
  std::uint64_t z = state;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

// How often each bit is set in a sample, and the squared correlation of each pair.
class BitStatistics {
 public:
  explicit BitStatistics(std::span<const Descriptor> sample)
      : blocks_((sample.size() + 63) / 64), columns_(kBits * blocks_), squared_(kBits * kBits) {
    transpose(sample);
    const auto n = static_cast<double>(sample.size());
    for (std::size_t i = 0; i < kBits; ++i) mean_[i] = static_cast<double>(both(i, i)) / n;
    for (std::size_t i = 0; i < kBits; ++i)
      for (std::size_t j = 0; j <= i; ++j)
        squared_[i * kBits + j] = squared_[j * kBits + i] = correlation(i, j, n);
  }

  double mean(std::size_t bit) const { return mean_[bit]; }
  double squared_correlation(std::size_t i, std::size_t j) const { return squared_[i * kBits + j]; }

 private:
  void transpose(std::span<const Descriptor> sample) {
    for (std::size_t s = 0; s < sample.size(); ++s)
      for (std::size_t bit = 0; bit < kBits; ++bit)
        columns_[bit * blocks_ + s / 64] |= ((sample[s].words[bit / 64] >> (bit % 64)) & 1)
                                            << (s % 64);
  }

  // In how many of the sample bits i and j are both set.
  std::uint64_t both(std::size_t i, std::size_t j) const {
    std::uint64_t count = 0;
    for (std::size_t k = 0; k < blocks_; ++k)
      count += static_cast<std::uint64_t>(
          std::popcount(columns_[i * blocks_ + k] & columns_[j * blocks_ + k]));
    return count;
  }

  // A bit that never changes counts as fully correlated with all: it is the last to be chosen.
  double correlation(std::size_t i, std::size_t j, double n) const {
    const double variances = mean_[i] * (1 - mean_[i]) * mean_[j] * (1 - mean_[j]);
    if (variances <= 0) return 1;
    const double covariance = static_cast<double>(both(i, j)) / n - mean_[i] * mean_[j];
    return covariance * covariance / variances;
  }

  std::size_t blocks_;
  std::vector<std::uint64_t> columns_;  // bit by bit, 64 of the sample in one integer
  std::array<double, kBits> mean_{};
  std::vector<double> squared_;
};

}  // namespace

KeyBits::KeyBits(std::span<const Descriptor> sample) {
  assert(!sample.empty());
  const BitStatistics statistics(sample);
  // cost[table][bit]: what choosing `bit` next costs, but for how often it is used by now.
  std::vector<std::array<double, kBits>> cost(kTables);
  for (auto& of_table : cost)
    for (std::size_t bit = 0; bit < kBits; ++bit) {
      const double imbalance = 2 * statistics.mean(bit) - 1;
      of_table[bit] = kImbalance * imbalance * imbalance;
    }

  constexpr double kChosen = 1e9;
  std::array<double, kBits> used{};
  std::uint64_t random = 1;
  for (auto& of_position : positions_)
    for (std::size_t table = 0; table < kTables; ++table) {
      std::size_t best = 0;
      double least = kChosen;
      for (std::size_t bit = 0; bit < kBits; ++bit) {
        const double total = cost[table][bit] + kUse * used[bit] + kJitter * next_random(random);
        if (total < least) {
          least = total;
          best = bit;
        }
      }
      of_position[table] = static_cast<std::uint8_t>(best);
      used[best] += 1;
      for (std::size_t bit = 0; bit < kBits; ++bit)
        cost[table][bit] += statistics.squared_correlation(best, bit);
      cost[table][best] = kChosen;
    }
}

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
