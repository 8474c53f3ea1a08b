#pragma once

#include <cstddef>

#include "loopd/config.h"

namespace loopd {

/// What a detector's map can hold. It follows from the config, is allocated when the detector is
/// made and never exceeded: whatever is full first, images are evicted.
struct MapCapacity {
  /// Images with as many features as the config allows. Of poorer images it holds more.
  std::size_t full_images = 0;
  std::size_t images = 0;  ///< at most, however poor
  std::size_t words_points = 0;
  std::size_t words_lines = 0;
  std::size_t bytes = 0;  ///< when all of it is in use

  /// With fewer full images a map is of no use.
  static constexpr std::size_t kLeastImages = 20;
};

/// Of the largest map that `config.memory_budget_bytes` holds; all 0 if that is none.
MapCapacity map_capacity(const Config& config);

/// Bytes of the smallest map that is of use.
std::size_t least_map_bytes(const Config& config);

}  // namespace loopd
