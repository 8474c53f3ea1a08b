#include "loop/eviction.h"

#include <algorithm>

namespace loopd {
namespace {

constexpr double kRevisitFactor = 0.5;  // of an image that closed a loop
constexpr double kPerProof = 0.5;       // more for each loop that found it
constexpr std::uint32_t kMostProofs = 4;
constexpr double kOldestFactor = 0.5;  // of the oldest image without any; newer ones in proportion

}  // namespace

double worth(std::span<const MapImage> searchable, std::size_t position) {
  const MapImage& image = searchable[position];
  const double after = position + 1 < searchable.size() ? searchable[position + 1].change : 0;
  double value = image.change + after;
  if (image.revisit) value *= kRevisitFactor;
  if (image.revisits > 0) return value * (1 + kPerProof * std::min(image.revisits, kMostProofs));
  const double youth = static_cast<double>(position) / static_cast<double>(searchable.size());
  return value * (kOldestFactor + (1 - kOldestFactor) * youth);
}

std::optional<std::size_t> least_worth(std::span<const MapImage> searchable) {
  std::optional<std::size_t> least;
  double least_value = 0;
  for (std::size_t i = 1; i + 1 < searchable.size(); ++i) {
    const double value = worth(searchable, i);
    if (least && value >= least_value) continue;
    least = i;
    least_value = value;
  }
  return least;
}

}  // namespace loopd
