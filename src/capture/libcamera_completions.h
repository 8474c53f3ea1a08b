#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "base/unique_fd.h"

namespace loopd {

/// What libcamera's threads tell ours: which buffers are done, and that the camera has gone. Each
/// buffer has one bit, so there is nothing to overflow, to lock or to allocate; in which order the
/// buffers were filled is told by their sequence numbers.
///
/// Thread: finish() and disconnect() by any thread, also in a signal of libcamera; the rest by the
/// one that waits.
class CompletionBoard {
 public:
  static constexpr std::size_t kMaxBuffers = 32;

  /// A board without a valid fd() could not be made (no descriptor left).
  CompletionBoard();

  /// Buffer `index` < kMaxBuffers is done.
  void finish(std::size_t index);
  void disconnect();

  /// Readable when there is something to take, or the camera has gone.
  int fd() const { return event_.get(); }

  /// The buffers that were done since the last call, a bit each; fd() is unreadable after it until
  /// the next finish() or disconnect().
  std::uint32_t take();

  bool disconnected() const { return disconnected_.load(std::memory_order_acquire); }

 private:
  void wake();

  std::atomic<std::uint32_t> done_{0};
  std::atomic<bool> disconnected_{false};
  UniqueFd event_;
};

}  // namespace loopd
