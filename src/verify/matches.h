#pragma once

#include <cstdint>
#include <optional>

namespace loopd {

/// A feature of the query matched with one of the candidate; each is used at most once.
struct FeatureMatch {
  std::uint32_t query = 0;
  std::uint32_t candidate = 0;
  std::uint16_t distance = 0;  ///< Hamming, bits
  double ratio = 0;            ///< distance / distance of the second neighbour, [0, 1]; 0 = best
  friend bool operator==(const FeatureMatch&, const FeatureMatch&) = default;
};

/// The nearest-neighbour distance ratio of `best` if it passes: best <= ratio * second, and best <=
/// max_distance. Two neighbours at distance 0 are ambiguous and do not pass. Without a second
/// neighbour there is no ratio; `best` must then be small in itself, at most max_distance / 2.
inline std::optional<double> nndr(int best, std::optional<int> second, double ratio,
                                  int max_distance) {
  if (best > max_distance) return std::nullopt;
  if (!second) {
    if (best > max_distance / 2) return std::nullopt;
    return max_distance > 0 ? static_cast<double>(best) / max_distance : 0.0;
  }
  if (*second == 0 || best > ratio * *second) return std::nullopt;
  return static_cast<double>(best) / *second;
}

}  // namespace loopd
