#include "app/detect_loop.h"

#include <string>
#include <utility>

#include "base/clock.h"
#include "events/records.h"

namespace loopd {

void DetectLoop::run() {
  while (std::optional<Frame> frame = mailbox_.take()) {
    const bool thrown_away = held_back();
    if (stopping_) return;
    if (!thrown_away) work_on(*std::move(frame));
  }
  // Only now are all reports of the recording handed over.
  if (capture_.ended && !stopping_)
    tell(LogLevel::kNotice, State::kCameraEnd, "the recording is at its end");
}

void DetectLoop::stop() {
  stopping_ = true;
  resume();
}

void DetectLoop::pause() {
  const std::lock_guard lock(pause_mutex_);
  paused_ = true;
}

void DetectLoop::resume() {
  {
    const std::lock_guard lock(pause_mutex_);
    paused_ = false;
  }
  pause_ended_.notify_all();
}

bool DetectLoop::held_back() {
  std::unique_lock lock(pause_mutex_);
  if (!paused_) return false;
  if (!live_times_) {
    holding_ = true;
    pause_ended_.wait(lock, [this] { return !paused_; });
    holding_ = false;
    return false;
  }
  const std::lock_guard totals_lock(totals_mutex_);
  ++totals_.skipped;
  return true;
}

void DetectLoop::work_on(Frame frame) {
  if (const std::uint32_t wanted = wanted_map_; wanted != map_) {
    detector_.clear();
    map_ = wanted;
    wakeup_.wake();
  }
  const std::int64_t taken_ns = monotonic_now_ns();
  detector_.process(frame, report_);
  frame.buffer.reset();  // the camera may have it back while the map is brought up to date
  if (record_class_of(report_)) {
    reports_.give(report_, {taken_ns, live_times_ ? report_.time_ns : std::nullopt, map_});
    wakeup_.wake();
  }
  detector_.absorb(report_);
  add_to_totals(report_);
  watch_errors();
}

void DetectLoop::add_to_totals(const Report& report) {
  const std::lock_guard lock(totals_mutex_);
  const bool failed = report.outcome == Outcome::kError;
  ++totals_.frames;
  totals_.errors += failed ? 1 : 0;
  totals_.errors_in_row = failed ? totals_.errors_in_row + 1 : 0;
  totals_.loops += record_class_of(report) == RecordClass::kLoop ? 1 : 0;
  totals_.candidates += record_class_of(report) == RecordClass::kCandidate ? 1 : 0;
  totals_.times.features_ns += report.times.features_ns;
  totals_.times.search_ns += report.times.search_ns;
  totals_.times.verify_ns += report.times.verify_ns;
  totals_.times.update_ns += report.times.update_ns;
  totals_.times.total_ns += report.times.total_ns;
  totals_.images = report.images;
  totals_.words_points = report.words_points;
  totals_.words_lines = report.words_lines;
  totals_.bytes = report.bytes;
  totals_.evictions = report.evictions;
}

void DetectLoop::watch_errors() {
  const bool failing = totals().errors_in_row >= kMostErrorsInRow;
  if (failing == std::exchange(failing_, failing)) return;
  if (failing)
    tell(LogLevel::kError, State::kDetectorError,
         std::to_string(kMostErrorsInRow) + " frames in a row failed in the detector");
  else
    tell(LogLevel::kNotice, State::kRunning, "the detector works again");
}

void DetectLoop::tell(LogLevel level, State state, std::string cause) {
  notices_.give({level, {state, monotonic_now_ns(), std::move(cause), ""}});
  wakeup_.wake();
}

DetectTotals DetectLoop::totals() const {
  const std::lock_guard lock(totals_mutex_);
  return totals_;
}

}  // namespace loopd
