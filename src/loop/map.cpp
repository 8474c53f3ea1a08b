#include "loop/map.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace loopd {
namespace {

auto lower_bound_id(const std::deque<MapImage>& images, ImageId id) {
  return std::lower_bound(images.begin(), images.end(), id,
                          [](const MapImage& image, ImageId key) { return image.id < key; });
}

}  // namespace

void ImageMap::push(MapImage image) {
  assert(newest() == nullptr || newest()->id < image.id);
  const std::size_t size = sizeof(MapImage) + image.features.bytes();
  waiting_.push_back(std::move(image));
  bytes_ += size;
}

const MapImage* ImageMap::ready(const WaitingClock& next) const {
  if (waiting_.size() < 2) return nullptr;  // the newest shows where the camera is
  const MapImage& oldest = waiting_.front();
  if (next.frames - oldest.taken.frames < config_.waiting_frames) return nullptr;
  const auto waiting_ns = static_cast<std::int64_t>(config_.waiting_s * 1e9);
  if (oldest.time_ns && next.ns - oldest.taken.ns < waiting_ns) return nullptr;
  return &oldest;
}

void ImageMap::admit() {
  assert(!waiting_.empty());
  images_.push_back(std::move(waiting_.front()));
  waiting_.pop_front();
}

const MapImage* ImageMap::newest() const {
  if (!waiting_.empty()) return &waiting_.back();
  return images_.empty() ? nullptr : &images_.back();
}

const MapImage* ImageMap::find(ImageId id) const {
  const auto it = lower_bound_id(images_, id);
  return it != images_.end() && it->id == id ? &*it : nullptr;
}

std::uint32_t ImageMap::position(ImageId id) const {
  const auto it = lower_bound_id(images_, id);
  assert(it != images_.end() && it->id == id);
  return static_cast<std::uint32_t>(it - images_.begin());
}

}  // namespace loopd
