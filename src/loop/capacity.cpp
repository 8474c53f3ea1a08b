#include "loop/capacity.h"

#include <algorithm>

#include "index/inverted_file.h"
#include "loop/blob_store.h"
#include "loop/map.h"

namespace loopd {
namespace {

// Of the features of an image, how many are words of their own once its probation is over. Measured
// with evictions: see README, "Memory".
constexpr double kWordsPerFeature = 0.33;
constexpr double kChunksPerFeature = 0.03;

// Images whose words are still on probation: nearly all their features may be new words.
constexpr std::size_t kMostProbation = 64;

// Poorer images need less room each; of them a map may hold so many times more.
constexpr std::size_t kPoorImages = 4;

VocabularyCapacity vocabulary_capacity(const IndexConfig& index, std::size_t full_images,
                                       std::size_t images, std::size_t descriptors) {
  const auto probation = std::min(static_cast<std::size_t>(index.probation_images), kMostProbation);
  const double kept = index.probation_images == 0 ? 1.0 : kWordsPerFeature;
  const auto features = static_cast<double>(full_images * descriptors);
  VocabularyCapacity capacity;
  capacity.images = images;
  capacity.descriptors = descriptors;
  capacity.words = static_cast<std::size_t>(kept * features) + (probation + 2) * descriptors;
  capacity.posting_chunks =
      static_cast<std::size_t>(kChunksPerFeature * features) + 2 * descriptors;
  return capacity;
}

// The map of exactly so many full images, whatever the budget.
MapLayout layout_of(const Config& config, std::size_t full_images) {
  const auto points = static_cast<std::size_t>(config.features.points);
  const auto lines = static_cast<std::size_t>(config.features.lines);
  MapLayout layout;
  layout.full_images = full_images;
  layout.images = std::min<std::size_t>(kPoorImages * full_images, Posting::kMaxImages);
  layout.blob_chunks = full_images * BlobStore::chunks_for(ImageMap::blob_bytes(points, lines));
  layout.points = vocabulary_capacity(config.index, full_images, layout.images, points);
  layout.lines = vocabulary_capacity(config.index, full_images, layout.images, lines);
  layout.bytes = BlobStore::bytes_for(layout.blob_chunks) + layout.images * sizeof(MapImage) +
                 Vocabulary::bytes_for(layout.points) + Vocabulary::bytes_for(layout.lines);
  return layout;
}

}  // namespace

MapLayout map_layout(const Config& config) {
  const auto budget =
      static_cast<std::size_t>(std::max<std::int64_t>(0, config.memory_budget_bytes));
  // The largest that fits, by bisection: bytes grow with images.
  std::size_t fits = 0;
  std::size_t too_many = Posting::kMaxImages;
  while (fits + 1 < too_many) {
    const std::size_t middle = (fits + too_many) / 2;
    (layout_of(config, middle).bytes <= budget ? fits : too_many) = middle;
  }
  return fits == 0 ? MapLayout{} : layout_of(config, fits);
}

MapCapacity map_capacity(const Config& config) {
  const MapLayout layout = map_layout(config);
  return {layout.full_images, layout.images, layout.points.words, layout.lines.words, layout.bytes};
}

std::size_t least_map_bytes(const Config& config) {
  return layout_of(config, MapCapacity::kLeastImages).bytes;
}

}  // namespace loopd
