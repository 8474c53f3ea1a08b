#pragma once

#include <cstdint>
#include <optional>

namespace loopd {

/// Numbers the frames of a camera over all its openings, from what drivers make of their counters,
/// and knows how many were lost on the way. Thread: one caller at a time.
class SequenceLedger {
 public:
  /// The stream starts anew; its first frame follows on the last one of the stream before.
  void begin(std::int64_t now_ns);

  struct Entry {
    std::uint64_t sequence = 0;  ///< greater than all before
    std::uint64_t lost = 0;      ///< frames skipped by the driver just before this one
  };
  /// A frame with the driver's number `driver_sequence` came at `now_ns`, after `passed_over`
  /// others had been given back unread. A counter that stands still, steps back, or leaps further
  /// than a camera can be fast tells nothing: no frame is then known to be lost.
  Entry enter(std::uint64_t driver_sequence, std::uint64_t passed_over, std::int64_t now_ns);

  /// Of the next frame, if none is lost.
  std::uint64_t next() const { return next_; }

 private:
  std::uint64_t next_ = 0;
  bool any_ = false;  ///< a frame has been numbered, in whatever stream
  std::optional<std::uint64_t> last_driver_;
  std::int64_t last_ns_ = 0;
};

/// What is wrong with a driver's time stamp.
enum class StampFault : std::uint8_t { kMissing, kFuture, kStill, kBack, kOld };
inline constexpr int kStampFaults = 5;

/// Decides whether a driver's time stamps can be believed. Thread: one caller at a time.
class StampJudge {
 public:
  /// A stream starts, of which no frame can be older than `now_ns`.
  void begin(std::int64_t now_ns);

  struct Verdict {
    std::int64_t time_ns = 0;         ///< to use: the stamp, or the arrival
    std::optional<StampFault> fault;  ///< why it is the arrival
    std::int64_t off_ns = 0;          ///< kFuture: by how much
  };
  /// The frame with the stamp `stamp_ns` came at `now_ns`. The times it returns always grow.
  Verdict judge(std::optional<std::int64_t> stamp_ns, std::int64_t now_ns);

 private:
  std::optional<StampFault> fault_of(std::int64_t stamp_ns, std::int64_t now_ns) const;

  std::int64_t begin_ns_ = 0;
  std::optional<std::int64_t> last_stamp_ns_;
  std::optional<std::int64_t> last_time_ns_;  ///< as returned, over all streams
};

}  // namespace loopd
