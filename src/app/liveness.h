#pragma once

#include <cstdint>

namespace loopd {

/// What the watchdog judges by, at one moment.
struct Vitals {
  std::uint64_t frames_detected = 0;
  std::uint64_t errors_in_row = 0;
  bool work_pending = false;         ///< frames wait for the detector or are in it
  bool nothing_to_do = false;        ///< the camera is known to be away, not started yet, or paused
  std::uint64_t camera_answers = 0;  ///< frames, errors and whatever else the camera has given
  bool camera_owes_answers = false;  ///< the capture thread runs: even a lost camera says so
};

/// Decides whether the watchdog may be fed: detection advances, or there is nothing to detect and
/// the reason is known. A hung detector, a hung driver that reports no loss, and a detector that
/// fails frame after frame are no life. Thread: one owner.
class Liveness {
 public:
  /// `patience_ns`: how long nothing may happen between two frames.
  Liveness(std::int64_t patience_ns, std::int64_t now_ns)
      : patience_ns_(patience_ns), answered_ns_(now_ns), advanced_ns_(now_ns) {}

  /// A driver may take this long to open a camera, USB time-outs included; more is a hang.
  static constexpr std::int64_t kLongestSilence_ns = 60'000'000'000;

  bool alive(const Vitals& vitals, std::int64_t now_ns);

 private:
  const std::int64_t patience_ns_;
  std::uint64_t frames_seen_ = 0;
  std::uint64_t answers_seen_ = 0;
  std::int64_t answered_ns_;
  std::int64_t advanced_ns_;
};

/// Patience for a camera of `fps` (0: unknown) under a watchdog of `watchdog_us`: half of the
/// watchdog's time, or five frames of a slow camera.
std::int64_t patience_for(double fps, std::uint64_t watchdog_us);

}  // namespace loopd
