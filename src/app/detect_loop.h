#pragma once

#include <atomic>
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
  StageTimes times;              ///< summed over all frames
  std::size_t images = 0;        ///< of the newest frame, as the next three
  std::size_t words_points = 0;
  std::size_t words_lines = 0;
  std::size_t bytes = 0;
};

/// The detect thread's work: the newest frame, process, hand the report over, wake main, absorb.
/// Does no I/O and logs nothing per frame.
/// Thread: run() is the body of the detect thread; stop() and totals() by any.
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
  void stop() { stopping_ = true; }
  /// A consistent copy.
  DetectTotals totals() const;

 private:
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
  bool failing_ = false;
  Report report_;
  mutable std::mutex totals_mutex_;
  DetectTotals totals_;
};

}  // namespace loopd
