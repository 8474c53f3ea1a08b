#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "capture/recording_format.h"
#include "loopd/frame.h"

namespace loopd {

/// Frames on their way to the disk: a fixed number of bytes, in which each takes what its size
/// needs, first in, first out. Drop policy: what is in it stays; a frame that finds no room is
/// counted, and the next one that finds some carries the count. Allocates nothing after its
/// construction.
/// Thread: put() by one thread at a time, front() and pop() by another, the rest by any.
class RecordingBuffer {
 public:
  /// At most this many frames wait, however small they are.
  static constexpr std::size_t kMaxFrames = 1024;

  struct Item {
    RecordedFrame frame;             ///< without number and checksum
    std::span<std::uint8_t> record;  ///< room for the header, the pixels, zeros as padding
  };

  /// Takes `bytes` of memory, and touches them. Throws std::bad_alloc.
  explicit RecordingBuffer(std::size_t bytes);

  /// Copies a frame in at once, or counts it as lost if there is no room. Does nothing once closed.
  /// Never waits for the taker.
  void put(const LumaView& view, std::uint64_t sequence, std::optional<std::int64_t> time_ns);

  /// The oldest frame, which stays until pop(). Waits for one, until close() or `deadline_ns`
  /// (CLOCK_MONOTONIC; none = without end); then none if there is none.
  std::optional<Item> front(std::optional<std::int64_t> deadline_ns);

  /// Frees the room of the oldest frame. Precondition: front() gave it.
  void pop();

  /// From now on nothing goes in; what is in it can still be taken.
  void close();

  bool closed() const;

  /// Forgets what is in it and counts it as lost.
  void lose_all();

  /// Frames for which there was no room, so far.
  std::uint64_t lost() const;

 private:
  std::optional<std::size_t> reserve(std::size_t bytes) const;
  std::optional<Item> admit(const LumaView& view);

  std::vector<std::uint8_t> memory_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  // All below guarded by mutex_. Items lie in memory_ in their order, but for one jump to its
  // start.
  std::vector<Item> items_;  ///< a ring of kMaxFrames
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  std::uint64_t lost_ = 0;
  std::uint64_t lost_before_ = 0;  ///< since the last frame that found room
  bool closed_ = false;
};

}  // namespace loopd
