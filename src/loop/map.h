#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "loop/blob_store.h"
#include "loopd/config.h"
#include "loopd/features.h"
#include "loopd/report.h"

namespace loopd {

/// What the waiting window counts by: frames, and time where it is known, less those for which the
/// camera was parked.
struct WaitingClock {
  std::int64_t frames = 0;
  std::int64_t ns = 0;
};

/// One image kept: where it came from, and what speaks for keeping it. Its features lie in the map.
struct MapImage {
  ImageId id = 0;
  std::uint64_t sequence = 0;
  std::optional<std::int64_t> time_ns;
  WaitingClock taken;  ///< when it was taken

  /// How much of the scene changed since the searchable image before it: 0 nothing, 1 everything,
  /// and the sum over images that were evicted between them.
  double change = 0;
  std::uint32_t revisits = 0;  ///< how often it was the match of a loop
  bool revisit = false;        ///< it closed a loop itself: an older image shows the same place

  std::uint32_t points = 0;
  std::uint32_t lines = 0;
  int width_px = 0;
  int height_px = 0;
  BlobStore::Blob blob = 0;
};

/// The images kept, in memory of a fixed size: the searchable ones, oldest first, then a waiting
/// window of the newest. Thread: const functions concurrently, else one caller at a time.
class ImageMap {
 public:
  /// For at most `images` images, whose features share `chunks` chunks of 4 KiB.
  /// Throws std::bad_alloc.
  ImageMap(const LoopConfig& config, std::size_t images, std::size_t chunks);

  /// Bytes of an image's features and word numbers.
  static std::size_t blob_bytes(std::size_t points, std::size_t lines);

  /// Whether push() can take an image of these features.
  bool has_room(const Features& features) const;
  /// Puts an image at the end of the waiting window, with its features. Ids and times grow.
  /// Precondition: has_room().
  void push(MapImage image, const Features& features);
  /// The oldest waiting image if a frame taken at `next` may find it, else null. Never the newest
  /// image kept: the camera has not moved away from it.
  const MapImage* ready(const WaitingClock& next) const;
  /// Makes that image searchable; `change` as in MapImage. Precondition: ready() was not null.
  void admit(double change);

  std::size_t searchable() const { return searchable_; }
  std::size_t waiting() const { return images_.size() - searchable_; }
  /// Whether the waiting window holds more than half of what there is room for.
  bool crowded_by_waiting() const;
  /// The newest image kept, or null.
  const MapImage* newest() const { return images_.empty() ? nullptr : &images_.back(); }
  /// A searchable image by id, or null.
  const MapImage* find(ImageId id) const;
  /// Position of a searchable image, 0 = oldest. Precondition: find(id) is not null.
  std::uint32_t position(ImageId id) const;
  const MapImage& at(std::size_t position) const { return images_[position]; }
  std::span<const MapImage> searchable_images() const { return {images_.data(), searchable_}; }

  /// The features of an image of this map; `features` keeps its capacity.
  void load(const MapImage& image, Features& features) const;
  /// Its word numbers, as many as points and lines.
  void load_words(const MapImage& image, std::span<std::uint32_t> points,
                  std::span<std::uint32_t> lines) const;
  void store_words(const MapImage& image, std::span<const std::uint32_t> points,
                   std::span<const std::uint32_t> lines);

  /// A frame matched searchable image `id`.
  void note_revisit(ImageId id);
  /// Forgets a searchable image: those around it lie that much farther apart.
  void remove(std::size_t position);
  /// Forgets the waiting image whose neighbours are nearest to each other in time, never the oldest
  /// or the newest. Returns false if there is none.
  bool thin_waiting();

  std::size_t bytes_in_use() const;

 private:
  void erase(std::size_t at);

  LoopConfig config_;
  std::size_t capacity_;
  BlobStore blobs_;
  std::vector<MapImage> images_;  // searchable ones, then waiting ones
  std::size_t searchable_ = 0;
  std::size_t waiting_chunks_ = 0;
};

}  // namespace loopd
