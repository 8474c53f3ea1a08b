#include "base/frame_pool.h"

#include <cassert>
#include <cstring>
#include <new>

namespace loopd {
namespace {

constexpr std::size_t kAlignment = 64;  // a cache line, and enough for every vector instruction

std::size_t aligned(std::size_t bytes) {
  if (bytes > SIZE_MAX - kAlignment) throw std::bad_alloc();
  return (bytes + kAlignment - 1) / kAlignment * kAlignment;
}

std::uint8_t* allocate(std::size_t count, std::size_t bytes_each) {
  if (bytes_each > SIZE_MAX / count) throw std::bad_alloc();
  const std::size_t bytes = count * bytes_each;
  auto* memory = static_cast<std::uint8_t*>(::operator new (bytes, std::align_val_t{kAlignment}));
  std::memset(memory, 0, bytes);  // takes the pages now: a full machine fails at the start
  return memory;
}

}  // namespace

void FramePool::AlignedDelete::operator()(std::uint8_t* memory) const noexcept {
  ::operator delete (memory, std::align_val_t{kAlignment});
}

FramePool::FramePool(std::size_t count, std::size_t bytes_each)
    : count_(count), bytes_each_(bytes_each) {
  assert(count >= 1 && bytes_each >= 1);
  const std::size_t step = aligned(bytes_each);
  memory_.reset(allocate(count, step));
  free_.reserve(count);
  for (std::size_t i = 0; i < count; ++i) free_.push_back(memory_.get() + i * step);
}

FramePool::~FramePool() {
  const std::lock_guard lock(mutex_);
  assert(free_.size() == count_ && "a frame outlived its pool");
}

FrameBuffer FramePool::take() {
  std::uint8_t* data = free_.back();
  free_.pop_back();
  return FrameBuffer(data, FrameBufferRelease(&FramePool::release, this));
}

FrameBuffer FramePool::acquire() {
  const std::lock_guard lock(mutex_);
  return free_.empty() ? FrameBuffer() : take();
}

FrameBuffer FramePool::acquire(std::stop_token stop) {
  std::unique_lock lock(mutex_);
  const bool free = freed_.wait(lock, stop, [this] { return !free_.empty(); });
  return free ? take() : FrameBuffer();
}

std::size_t FramePool::available() const {
  const std::lock_guard lock(mutex_);
  return free_.size();
}

void FramePool::release(void* owner, std::uint8_t* data) noexcept {
  auto* pool = static_cast<FramePool*>(owner);
  // Told under the lock: once it is released, the pool may be destroyed by whoever waited.
  const std::lock_guard lock(pool->mutex_);
  pool->free_.push_back(data);
  pool->freed_.notify_one();
}

}  // namespace loopd
