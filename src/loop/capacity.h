#pragma once

#include <cstddef>

#include "index/vocabulary.h"
#include "loopd/capacity.h"

namespace loopd {

/// How a map's memory is divided (DESIGN section 4).
struct MapLayout {
  std::size_t full_images = 0;  ///< as in MapCapacity, as `images` and `bytes`
  std::size_t images = 0;
  std::size_t blob_chunks = 0;  ///< of 4 KiB: features and word numbers of the images
  VocabularyCapacity points;
  VocabularyCapacity lines;
  std::size_t bytes = 0;
};

/// The largest map that `config.memory_budget_bytes` holds; all 0 if it holds none.
MapLayout map_layout(const Config& config);

}  // namespace loopd
