#include "loop/map.h"

#include <algorithm>
#include <cassert>

namespace loopd {
namespace {

// The parts of an image's blob, in this order.
struct Layout {
  Layout(std::size_t points, std::size_t lines)
      : line_words(points * sizeof(std::uint32_t)),
        points_at(line_words + lines * sizeof(std::uint32_t)),
        lines_at(points_at + points * sizeof(Point)),
        point_descriptors(lines_at + lines * sizeof(Line)),
        line_descriptors(point_descriptors + points * sizeof(Descriptor)),
        end(line_descriptors + lines * sizeof(Descriptor)) {}
  explicit Layout(const MapImage& image) : Layout(image.points, image.lines) {}

  static constexpr std::size_t point_words = 0;
  std::size_t line_words;
  std::size_t points_at;
  std::size_t lines_at;
  std::size_t point_descriptors;
  std::size_t line_descriptors;
  std::size_t end;
};

std::size_t chunks_of(const MapImage& image) { return BlobStore::chunks_for(Layout(image).end); }

template <class T>
void read_into(const BlobStore& blobs, BlobStore::Blob blob, std::size_t at, std::size_t count,
               std::vector<T>& out) {
  out.resize(count);
  blobs.read(blob, at, std::as_writable_bytes(std::span(out)));
}

template <class Iterator>
Iterator lower_bound_id(Iterator begin, Iterator end, ImageId id) {
  return std::lower_bound(begin, end, id,
                          [](const MapImage& image, ImageId key) { return image.id < key; });
}

}  // namespace

ImageMap::ImageMap(const LoopConfig& config, std::size_t images, std::size_t chunks)
    : config_(config), capacity_(images), blobs_(chunks) {
  images_.reserve(images);
}

std::size_t ImageMap::blob_bytes(std::size_t points, std::size_t lines) {
  return Layout(points, lines).end;
}

bool ImageMap::has_room(const Features& features) const {
  const std::size_t bytes = blob_bytes(features.points.size(), features.lines.size());
  return images_.size() < capacity_ && BlobStore::chunks_for(bytes) <= blobs_.free_chunks();
}

void ImageMap::push(MapImage image, const Features& features) {
  assert(newest() == nullptr || newest()->id < image.id);
  assert(has_room(features));
  image.points = static_cast<std::uint32_t>(features.points.size());
  image.lines = static_cast<std::uint32_t>(features.lines.size());
  image.width_px = features.width_px;
  image.height_px = features.height_px;
  const Layout layout(image);
  image.blob = blobs_.allocate(layout.end);
  blobs_.write(image.blob, layout.points_at, std::as_bytes(std::span(features.points)));
  blobs_.write(image.blob, layout.lines_at, std::as_bytes(std::span(features.lines)));
  blobs_.write(image.blob, layout.point_descriptors,
               std::as_bytes(std::span(features.point_descriptors)));
  blobs_.write(image.blob, layout.line_descriptors,
               std::as_bytes(std::span(features.line_descriptors)));
  waiting_chunks_ += chunks_of(image);
  images_.push_back(image);
}

const MapImage* ImageMap::ready(const WaitingClock& next) const {
  if (waiting() < 2) return nullptr;  // the newest shows where the camera is
  const MapImage& oldest = images_[searchable_];
  if (next.frames - oldest.taken.frames < config_.waiting_frames) return nullptr;
  const auto waiting_ns = static_cast<std::int64_t>(config_.waiting_s * 1e9);
  if (oldest.time_ns && next.ns - oldest.taken.ns < waiting_ns) return nullptr;
  return &oldest;
}

void ImageMap::admit(double change) {
  assert(waiting() > 0);
  MapImage& admitted = images_[searchable_++];
  admitted.change = change;
  waiting_chunks_ -= chunks_of(admitted);
}

bool ImageMap::crowded_by_waiting() const {
  return 2 * waiting_chunks_ > blobs_.chunks() || 2 * waiting() > capacity_;
}

const MapImage* ImageMap::find(ImageId id) const {
  const auto end = images_.begin() + static_cast<std::ptrdiff_t>(searchable_);
  const auto it = lower_bound_id(images_.begin(), end, id);
  return it != end && it->id == id ? &*it : nullptr;
}

std::uint32_t ImageMap::position(ImageId id) const {
  const MapImage* const image = find(id);
  assert(image != nullptr);
  return static_cast<std::uint32_t>(image - images_.data());
}

void ImageMap::load(const MapImage& image, Features& features) const {
  const Layout layout(image);
  features.width_px = image.width_px;
  features.height_px = image.height_px;
  read_into(blobs_, image.blob, layout.points_at, image.points, features.points);
  read_into(blobs_, image.blob, layout.lines_at, image.lines, features.lines);
  read_into(blobs_, image.blob, layout.point_descriptors, image.points, features.point_descriptors);
  read_into(blobs_, image.blob, layout.line_descriptors, image.lines, features.line_descriptors);
}

void ImageMap::load_words(const MapImage& image, std::span<std::uint32_t> points,
                          std::span<std::uint32_t> lines) const {
  assert(points.size() == image.points && lines.size() == image.lines);
  blobs_.read(image.blob, Layout::point_words, std::as_writable_bytes(points));
  blobs_.read(image.blob, Layout(image).line_words, std::as_writable_bytes(lines));
}

void ImageMap::store_words(const MapImage& image, std::span<const std::uint32_t> points,
                           std::span<const std::uint32_t> lines) {
  assert(points.size() == image.points && lines.size() == image.lines);
  blobs_.write(image.blob, Layout::point_words, std::as_bytes(points));
  blobs_.write(image.blob, Layout(image).line_words, std::as_bytes(lines));
}

void ImageMap::note_revisit(ImageId id) { ++images_[position(id)].revisits; }

void ImageMap::erase(std::size_t at) {
  blobs_.release(images_[at].blob, Layout(images_[at]).end);
  images_.erase(images_.begin() + static_cast<std::ptrdiff_t>(at));
}

void ImageMap::remove(std::size_t position) {
  assert(position < searchable_);
  if (position + 1 < searchable_) images_[position + 1].change += images_[position].change;
  erase(position);
  --searchable_;
}

bool ImageMap::thin_waiting() {
  if (waiting() < 3) return false;
  std::size_t closest = searchable_ + 1;
  const auto span_around = [&](std::size_t i) { return images_[i + 1].id - images_[i - 1].id; };
  for (std::size_t i = closest + 1; i + 1 < images_.size(); ++i)
    if (span_around(i) < span_around(closest)) closest = i;
  waiting_chunks_ -= chunks_of(images_[closest]);
  erase(closest);
  return true;
}

std::size_t ImageMap::bytes_in_use() const {
  return (blobs_.chunks() - blobs_.free_chunks()) * BlobStore::kChunkBytes +
         images_.size() * sizeof(MapImage);
}

}  // namespace loopd
