#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "loopd/features.h"

namespace loopd {

/// Seeded descriptors for tests and benchmarks. The same seed gives the same sequence everywhere.
class DescriptorSamples {
 public:
  explicit DescriptorSamples(std::uint64_t seed) : state_(seed) {
    for (auto& row : mixing_)
      for (auto& weight : row) weight = static_cast<std::int8_t>(below(17)) - 8;
  }

  /// The next of the sequence, 64 random bits (SplitMix64; Steele, Lea, Flood 2014).
  std::uint64_t next() {
    state_ += 0x9e3779b97f4a7c15u;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

  /// [0, n)
  std::uint32_t below(std::uint32_t n) {
    return static_cast<std::uint32_t>(((next() >> 32) * n) >> 32);
  }

  /// All bits independent and balanced.
  Descriptor independent() { return {{next(), next(), next(), next()}}; }

  /// Bits correlated as those of image descriptors are: each compares a few of kFactors hidden
  /// quantities, as an ORB bit compares smoothed pixels of one patch, and some are unbalanced.
  Descriptor correlated() {
    std::array<int, kFactors> hidden;
    for (int& value : hidden)  // the sum of four is bell-shaped
      value = static_cast<int>(below(64) + below(64) + below(64) + below(64)) - 126;
    Descriptor descriptor;
    for (std::size_t bit = 0; bit < 256; ++bit) {
      int sum = static_cast<int>(bit % 16) * 40 - 300;
      for (std::size_t i = 0; i < kFactors; ++i) sum += mixing_[bit][i] * hidden[i];
      sum += static_cast<int>(below(1200)) - 600;
      if (sum > 0) descriptor.words[bit / 64] |= std::uint64_t{1} << (bit % 64);
    }
    return descriptor;
  }

  /// `descriptor` with `flips` random bits turned, some perhaps twice.
  Descriptor noisy(Descriptor descriptor, int flips) {
    for (int i = 0; i < flips; ++i) {
      const std::uint32_t bit = below(256);
      descriptor.words[bit / 64] ^= std::uint64_t{1} << (bit % 64);
    }
    return descriptor;
  }

 private:
  static constexpr std::size_t kFactors = 24;
  std::uint64_t state_;
  std::array<std::array<std::int8_t, kFactors>, 256> mixing_{};
};

}  // namespace loopd
