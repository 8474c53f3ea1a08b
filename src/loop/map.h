#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

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

/// One image kept: where it came from and what it shows.
struct MapImage {
  ImageId id = 0;
  std::uint64_t sequence = 0;
  std::optional<std::int64_t> time_ns;
  WaitingClock taken;  ///< when it was taken
  Features features;
};

/// The images kept: a waiting window of the newest, and the searchable ones, oldest first.
/// Thread: one caller at a time.
class ImageMap {
 public:
  explicit ImageMap(const LoopConfig& config) : config_(config) {}

  /// Puts an image at the end of the waiting window. Ids and times grow.
  void push(MapImage image);
  /// The oldest waiting image if a frame taken at `next` may find it, else null. Never the newest
  /// image kept: the camera has not moved away from it.
  const MapImage* ready(const WaitingClock& next) const;
  /// Makes that image searchable. Precondition: ready() was not null.
  void admit();

  std::size_t searchable() const { return images_.size(); }
  /// The newest image kept, or null.
  const MapImage* newest() const;
  /// A searchable image by id, or null.
  const MapImage* find(ImageId id) const;
  /// Position of a searchable image, 0 = oldest. Precondition: find(id) is not null.
  std::uint32_t position(ImageId id) const;
  const MapImage& at(std::uint32_t position) const { return images_[position]; }

  std::size_t bytes() const { return bytes_; }

 private:
  LoopConfig config_;
  std::deque<MapImage> waiting_;
  std::deque<MapImage> images_;
  std::size_t bytes_ = 0;
};

}  // namespace loopd
