#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "app/capture_loop.h"
#include "app/daemon_config.h"
#include "app/detect_loop.h"
#include "app/notices.h"
#include "app/report_queue.h"
#include "app/wakeup.h"
#include "base/frame_pool.h"
#include "base/lanes.h"
#include "base/mailbox.h"
#include "base/result.h"
#include "base/thread.h"
#include "capture/camera.h"
#include "loopd/detector.h"

namespace loopd {

/// Camera -> mailbox -> detector -> reports: the capture, detect and lines threads and what they
/// share. Whoever owns it waits on wake_fd() and takes reports and notices.
/// Thread: one owner, which alone calls this interface.
class Pipeline {
 public:
  /// Opens the camera and allocates everything; no thread runs yet. Precondition:
  /// validate(config) is empty. Errors: the camera, or the lines thread.
  static Result<std::unique_ptr<Pipeline>> open(const DaemonConfig& config);
  ~Pipeline();
  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  /// Starts to take frames; once only. Error: a thread cannot start.
  Status start();
  /// Goes on with another live camera, or the same with other settings; map and detector stay.
  /// Waits until the old one is closed, a second at most but for a driver that hangs. Error: no
  /// thread, after which nothing is captured any more. Precondition: `config` is live.
  Status replace_camera(const CameraConfig& config);
  /// See DetectLoop.
  void pause() { detect_.pause(); }
  void resume() { detect_.resume(); }
  void reset_map() { detect_.reset(); }
  std::uint32_t map() const { return detect_.map(); }
  /// Where a recording listens for frames, those too that the detector never sees.
  RecordingTap& recording_tap() { return tap_; }
  /// Ends capture, then detection after its current frame, and joins both. What was handed over
  /// before can still be taken. May be called any number of times.
  void stop();

  /// Readable when there may be something to take; drain_wakeups() first, then take until empty.
  int wake_fd() const { return wakeup_.fd(); }
  void drain_wakeups() { wakeup_.drain(); }
  std::optional<Notice> take_notice() { return notices_.take(); }
  ReportQueue::Lent take_report() { return reports_.take(); }

  DetectTotals totals() const { return detect_.totals(); }
  /// Bytes of the map when it is full.
  std::size_t map_bytes() const { return map_bytes_; }
  const CaptureCounters& capture() const { return capture_counters_; }
  /// Frames that never reached the detector, by whoever's fault.
  std::uint64_t dropped_frames() const {
    return dropped_before_ + camera_->dropped() + mailbox_.overwritten();
  }
  /// Frames whose time stamp was replaced, see Camera::restamped().
  std::uint64_t restamped_frames() const { return restamped_before_ + camera_->restamped(); }
  /// Frames that wait for the detector or are in it.
  bool work_pending() const;
  std::uint64_t dropped_reports() const { return reports_.dropped(); }
  /// Why a thread died, if one did: nothing moves any more.
  std::optional<std::string> failure() const;
  /// Threads that run without the CPUs or the priority asked for.
  std::vector<Error> thread_shortfalls() const;
  std::string camera_text() const { return camera_->describe(); }

 private:
  struct Parts;
  Pipeline(const DaemonConfig& config, Parts parts);
  NamedThread::OnException on_exception();
  Status start_capture();
  Status start_thread(NamedThread& thread, const ThreadOptions& options,
                      std::function<void()> body);

  const ThreadsConfig threads_;
  const std::vector<int> all_cpus_;  ///< that the process may use, before main has its own
  // In this order: what is declared later uses what is declared before.
  std::unique_ptr<FramePool> pool_;
  std::unique_ptr<Camera> camera_;
  std::unique_ptr<TwoLanes> lanes_;  ///< null: one lane
  Wakeup wakeup_;
  Mailbox<Frame> mailbox_;
  RecordingTap tap_;
  NoticeQueue notices_;
  ReportQueue reports_;
  CaptureCounters capture_counters_;
  std::uint64_t dropped_before_ = 0;    ///< by the cameras before this one
  std::uint64_t restamped_before_ = 0;  ///< likewise
  Detector detector_;
  const std::size_t map_bytes_;
  CaptureLoop capture_;
  DetectLoop detect_;
  mutable std::mutex failure_mutex_;
  std::optional<std::string> failure_;
  NamedThread capture_thread_;
  NamedThread detect_thread_;
};

}  // namespace loopd
