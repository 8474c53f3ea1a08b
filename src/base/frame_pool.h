#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <stop_token>
#include <vector>

#include "loopd/frame.h"

namespace loopd {

/// A fixed number of equal, 64-byte aligned pixel buffers, allocated once at the start.
///
/// A buffer returns to its pool by the destruction of its FrameBuffer, in any thread. The pool
/// must outlive all its buffers; its destructor asserts that every one is back.
/// Thread: thread-safe.
class FramePool {
 public:
  /// Allocates `count` buffers of `bytes_each` bytes. Throws std::bad_alloc.
  /// Precondition: both >= 1.
  FramePool(std::size_t count, std::size_t bytes_each);
  ~FramePool();
  FramePool(const FramePool&) = delete;
  FramePool& operator=(const FramePool&) = delete;

  /// A free buffer, or an empty pointer if there is none. Never blocks for one.
  FrameBuffer acquire();

  /// Waits for a free buffer; an empty pointer if `stop` was requested before one was free.
  FrameBuffer acquire(std::stop_token stop);

  std::size_t count() const { return count_; }
  std::size_t bytes_each() const { return bytes_each_; }
  /// Buffers that are free at this moment.
  std::size_t available() const;

 private:
  static void release(void* owner, std::uint8_t* data) noexcept;
  FrameBuffer take();

  struct AlignedDelete {
    void operator()(std::uint8_t* memory) const noexcept;
  };

  const std::size_t count_;
  const std::size_t bytes_each_;
  std::unique_ptr<std::uint8_t[], AlignedDelete> memory_;
  mutable std::mutex mutex_;
  std::condition_variable_any freed_;
  std::vector<std::uint8_t*> free_;  ///< guarded by mutex_; capacity `count_` from the start
};

}  // namespace loopd
