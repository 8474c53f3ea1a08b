#include "capture/recording_buffer.h"

#include <cassert>
#include <chrono>
#include <cstring>

namespace loopd {
namespace {

constexpr int kMaxSide_px = 65535;  // of the format

bool recordable(const LumaView& view) {
  return view.data != nullptr && view.width_px >= 1 && view.height_px >= 1 &&
         view.width_px <= kMaxSide_px && view.height_px <= kMaxSide_px;
}

void copy_pixels(const LumaView& view, std::span<std::uint8_t> record) {
  const auto width = static_cast<std::size_t>(view.width_px);
  std::uint8_t* out = record.data() + kRecordingFrameHeaderBytes;
  for (int y = 0; y < view.height_px; ++y, out += width)
    std::memcpy(out, view.data + static_cast<std::ptrdiff_t>(y) * view.stride_bytes, width);
  std::memset(out, 0, static_cast<std::size_t>(record.data() + record.size() - out));
}

}  // namespace

RecordingBuffer::RecordingBuffer(std::size_t bytes) : memory_(bytes), items_(kMaxFrames) {}

void RecordingBuffer::put(const LumaView& view, std::uint64_t sequence,
                          std::optional<std::int64_t> time_ns) {
  std::optional<Item> item;
  {
    const std::lock_guard lock(mutex_);
    item = admit(view);
  }
  if (!item) return;
  item->frame.sequence = sequence;
  item->frame.time_ns = time_ns;
  copy_pixels(view, item->record);  // outside the lock: nobody else gives room away
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    items_[(first_ + count_) % kMaxFrames] = *item;
    ++count_;
  }
  changed_.notify_one();
}

// Room for a frame, or none and the frame counted as lost.
std::optional<RecordingBuffer::Item> RecordingBuffer::admit(const LumaView& view) {
  if (closed_) return std::nullopt;
  const ImageSize size{view.width_px, view.height_px};
  std::optional<std::size_t> at;
  if (recordable(view) && count_ < kMaxFrames) at = reserve(recording_record_bytes(size));
  if (!at) {
    ++lost_;
    ++lost_before_;
    return std::nullopt;
  }
  Item item;
  item.frame.size = size;
  item.frame.lost_before = lost_before_;
  item.record = std::span(memory_).subspan(*at, recording_record_bytes(size));
  lost_before_ = 0;
  return item;
}

// Where the next item can lie in one piece: behind the newest, or at the start.
std::optional<std::size_t> RecordingBuffer::reserve(std::size_t bytes) const {
  const auto offset = [this](const std::uint8_t* p) {
    return static_cast<std::size_t>(p - memory_.data());
  };
  std::size_t begin = 0;  // of the oldest item
  std::size_t end = 0;    // of the newest
  if (count_ > 0) {
    const Item& newest = items_[(first_ + count_ - 1) % kMaxFrames];
    begin = offset(items_[first_].record.data());
    end = offset(newest.record.data()) + newest.record.size();
  }
  const bool jumped = count_ > 0 && end <= begin;
  const std::size_t limit = jumped ? begin : memory_.size();
  if (bytes <= limit - end) return end;
  if (!jumped && bytes <= begin) return 0;
  return std::nullopt;
}

std::optional<RecordingBuffer::Item> RecordingBuffer::front(
    std::optional<std::int64_t> deadline_ns) {
  const auto ready = [this] { return closed_ || count_ > 0; };
  std::unique_lock lock(mutex_);
  if (deadline_ns)
    changed_.wait_until(
        lock, std::chrono::steady_clock::time_point(std::chrono::nanoseconds(*deadline_ns)), ready);
  else
    changed_.wait(lock, ready);
  if (count_ == 0) return std::nullopt;
  return items_[first_];
}

void RecordingBuffer::pop() {
  const std::lock_guard lock(mutex_);
  assert(count_ > 0);
  first_ = (first_ + 1) % kMaxFrames;
  --count_;
}

void RecordingBuffer::close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  changed_.notify_all();
}

bool RecordingBuffer::closed() const {
  const std::lock_guard lock(mutex_);
  return closed_;
}

void RecordingBuffer::lose_all() {
  const std::lock_guard lock(mutex_);
  lost_ += count_;
  count_ = 0;
}

std::uint64_t RecordingBuffer::lost() const {
  const std::lock_guard lock(mutex_);
  return lost_;
}

}  // namespace loopd
