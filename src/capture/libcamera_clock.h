#pragma once

#include <cstdint>
#include <optional>

namespace loopd {

/// CLOCK_MONOTONIC and CLOCK_BOOTTIME at the same instant, nanoseconds. They differ by the time the
/// machine has spent suspended.
struct ClockPair {
  std::int64_t monotonic_ns = 0;
  std::int64_t boottime_ns = 0;
  std::int64_t offset_ns() const { return boottime_ns - monotonic_ns; }
};

/// Reads both clocks: BOOTTIME between two readings of MONOTONIC, the closest of three tries.
/// Error of offset_ns(): well below 1 us unless the thread is preempted three times.
ClockPair clock_pair_now();

/// Turns libcamera's time stamps into CLOCK_MONOTONIC.
///
/// libcamera documents SensorTimestamp as CLOCK_BOOTTIME, but pipelines pass on what the kernel
/// driver stamped, which for V4L2 drivers mostly is CLOCK_MONOTONIC. So the first stamp decides:
/// its clock is the one that makes it younger in absolute value (of equals, MONOTONIC), for the
/// whole stream. While both clocks are within 1 ms of each other nothing needs to be decided.
/// A stamp taken before a suspend and converted after it gets its own time, not one that is too
/// early by the suspend.
///
/// Thread: one caller at a time.
class StampClock {
 public:
  enum class Source : std::uint8_t { kUndecided, kMonotonic, kBoottime };

  /// The stamp in CLOCK_MONOTONIC; none for 0, which is libcamera's "not known". Call it once a
  /// frame, with the clocks as they are then: that is how it sees a suspend.
  std::optional<std::int64_t> to_monotonic_ns(std::uint64_t stamp_ns, ClockPair now);

  Source source() const { return source_; }

 private:
  void follow(ClockPair now);
  void decide(std::int64_t stamp_ns, ClockPair now);

  Source source_ = Source::kUndecided;
  std::int64_t offset_ns_ = 0;    ///< as of the last call
  std::int64_t previous_ns_ = 0;  ///< before the last suspend
  std::int64_t changed_ns_ = 0;   ///< MONOTONIC when the last suspend was noticed; 0: none was
  bool known_ = false;
};

}  // namespace loopd
