#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "verify/correspondences.h"

namespace loopd {

/// Random numbers of our own (SplitMix64, Steele and others 2014): the same on every platform.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

  /// In [0, bound). Precondition: 0 < bound < 2^32.
  std::size_t below(std::size_t bound) {
    return static_cast<std::size_t>(((next() >> 32) * bound) >> 32);
  }

 private:
  std::uint64_t state_;
};

/// Draws minimal samples, trusted correspondences first and points before line end points.
class Sampler {
 public:
  explicit Sampler(const Correspondences& c) : correspondences_(c) {}

  /// Fills `sample` with different entries. Sample number `iteration` comes from the best eighth,
  /// quarter, half or all of each list, in turn. False if there are fewer entries than asked for.
  bool draw(int iteration, Random& random, std::span<std::uint32_t> sample) const;

  /// Probability that one draw of a sample is an inlier, if `points` and `ends` many are.
  double inlier_share(std::size_t points, std::size_t ends) const;

 private:
  const Correspondences& correspondences_;
};

}  // namespace loopd
