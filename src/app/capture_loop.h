#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "app/notices.h"
#include "app/wakeup.h"
#include "base/mailbox.h"
#include "capture/camera.h"
#include "capture/recording_tap.h"

namespace loopd {

/// What the capture thread counts. Thread-safe.
struct CaptureCounters {
  std::atomic<std::uint64_t> frames = 0;   ///< delivered by the camera
  std::atomic<std::uint64_t> corrupt = 0;  ///< errors that cost one frame
  std::atomic<std::uint64_t> losses = 0;   ///< times that the camera was lost or stalled
  std::atomic<std::uint64_t> answers = 0;  ///< of the camera, of whatever kind
  std::atomic<bool> away = false;          ///< the camera is known to be lost, stalled or ended
  std::atomic<bool> ended = false;         ///< a recording came to its end
};

/// The capture thread's work: moves frames from the camera to the mailbox, and tells what happens
/// to the camera. A lost camera is not an end: the camera itself keeps trying to come back.
/// Thread: run() is the body of the capture thread; it returns after Camera::interrupt(), the end
/// of a recording, or the mailbox's close. Then it may be run again, with another camera.
class CaptureLoop {
 public:
  /// `lock_step`: wait until the detector has taken each frame. All arguments outlive the loop.
  CaptureLoop(Mailbox<Frame>& mailbox, RecordingTap& tap, NoticeQueue& notices,
              const Wakeup& wakeup, CaptureCounters& counters, bool lock_step)
      : mailbox_(mailbox),
        tap_(tap),
        notices_(notices),
        wakeup_(wakeup),
        counters_(counters),
        lock_step_(lock_step) {}

  void run(Camera& camera);

 private:
  static constexpr std::size_t kFaults = static_cast<std::size_t>(CameraFault::kStreamError) + 1;

  static constexpr std::size_t kNotices =
      static_cast<std::size_t>(CameraNotice::Kind::kSettings) + 1;

  /// A notice that was logged, and when.
  struct Noticed {
    std::string message;
    std::int64_t time_ns = 0;
  };

  void begin_again();
  bool handle(Frame frame);
  bool handle(const CameraError& error);
  bool handle(EndOfStream);
  bool handle(const CameraNotice& notice);
  bool handle(Interrupted) { return false; }
  void camera_away(const CameraError& error);
  bool is_news(const CameraError& error);
  void frame_lost(const CameraError& error);
  void tell(const Notice& notice);

  Mailbox<Frame>& mailbox_;
  RecordingTap& tap_;
  NoticeQueue& notices_;
  const Wakeup& wakeup_;
  CaptureCounters& counters_;
  const bool lock_step_;
  std::optional<State> state_;                   ///< the last one told
  std::optional<CameraFault> fault_;             ///< and its cause, if it has one
  std::optional<std::int64_t> denied_since_ns_;  ///< of a node that has just come
  std::array<Noticed, kNotices> noticed_{};
  std::array<std::optional<std::int64_t>, kFaults> told_ns_{};  ///< when each fault was last logged
};

}  // namespace loopd
