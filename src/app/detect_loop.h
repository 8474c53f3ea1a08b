#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>

#include "app/capture_loop.h"
#include "app/notices.h"
#include "app/report_queue.h"
#include "app/wakeup.h"
#include "base/mailbox.h"
#include "loopd/detector.h"

namespace loopd {

/// What the detector has done since the start.
struct DetectTotals {
  std::uint64_t frames = 0;
  std::uint64_t errors = 0;
  std::uint64_t errors_in_row = 0;
  std::uint64_t loops = 0;
  std::uint64_t candidates = 0;  ///< reached verification and were rejected
  std::uint64_t skipped = 0;     ///< taken from the mailbox and thrown away while paused
  StageTimes times;              ///< summed over all frames
  std::size_t images = 0;        ///< of the newest frame, as the next three
  std::size_t words_points = 0;
  std::size_t words_lines = 0;
  std::size_t bytes = 0;
  Evictions evictions;
};

/// The detect thread's work: the newest frame, process, hand the report over, wake main, absorb.
/// Does no I/O and logs nothing per frame.
/// Thread: run() is the body of the detect thread; everything else by any.
class DetectLoop {
 public:
  /// So many frames in a row that fail in the detector are a broken detector, not broken frames.
  static constexpr std::uint64_t kMostErrorsInRow = 10;

  /// `live_times`: frame times are of the daemon's clock. All references outlive the loop.
  DetectLoop(Detector& detector, Mailbox<Frame>& mailbox, ReportQueue& reports,
             NoticeQueue& notices, const Wakeup& wakeup, const CaptureCounters& capture,
             bool live_times)
      : detector_(detector),
        mailbox_(mailbox),
        reports_(reports),
        notices_(notices),
        wakeup_(wakeup),
        capture_(capture),
        live_times_(live_times) {}

  /// Returns when the mailbox is closed and empty, or after the current frame once stopped.
  void run();
  void stop();
  /// A consistent copy.
  DetectTotals totals() const;

  /// While paused no frame is worked on: in real time they are thrown away, in lock-step the
  /// recording waits.
  void pause();
  void resume();
  /// A frame waits for the end of a pause.
  bool holding() const { return holding_; }
  /// Empties the map before the next frame. Reports are marked with the number of resets before
  /// them (TakenReport::map), so that none is taken for one of another map.
  void reset() { wanted_map_.fetch_add(1, std::memory_order_relaxed); }
  /// Resets done. Read before reports are taken, it tells that those of older maps are all there.
  std::uint32_t map() const { return map_; }

 private:
  /// True if the frame is thrown away. Waits while a recording is paused.
  bool held_back();
  void work_on(Frame frame);
  void add_to_totals(const Report& report);
  void watch_errors();
  void tell(LogLevel level, State state, std::string cause);

  Detector& detector_;
  Mailbox<Frame>& mailbox_;
  ReportQueue& reports_;
  NoticeQueue& notices_;
  const Wakeup& wakeup_;
  const CaptureCounters& capture_;
  const bool live_times_;
  std::atomic<bool> stopping_ = false;
  std::atomic<std::uint32_t> wanted_map_ = 0;
  std::atomic<std::uint32_t> map_ = 0;  ///< written by the detect thread alone
  std::mutex pause_mutex_;
  std::condition_variable pause_ended_;
  bool paused_ = false;
  std::atomic<bool> holding_ = false;
  bool failing_ = false;
  Report report_;
  mutable std::mutex totals_mutex_;
  DetectTotals totals_;
};

}  // namespace loopd
