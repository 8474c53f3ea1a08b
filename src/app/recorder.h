#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "app/event_loop.h"
#include "base/result.h"
#include "base/unique_fd.h"
#include "capture/recording_tap.h"
#include "capture/recording_writer.h"

namespace loopd {

/// At most one recording at a time of what the camera gives, from a request until its end is told.
/// Thread: one owner, that of the event loop.
class Recorder {
 public:
  using OnEnd = std::function<void(const RecordingResult&)>;

  /// `loop` and `tap` outlive it.
  Recorder(EventLoop& loop, RecordingTap& tap) : loop_(loop), tap_(tap) {}
  ~Recorder() { end(); }
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  /// Records into `file` (see RecordingWriter::start) until a limit, a failure or stop(); then
  /// `on_end` is called by the event loop. Errors: one is under way; those of RecordingWriter.
  Status start(UniqueFd file, const RecordingOptions& options, OnEnd on_end);

  /// Ends the recording under way soon; what was offered before is still written. No-op without.
  void stop();

  /// The same, and waits until all is written and on_end was called: as long as the disk takes.
  void finish_now();

  /// How far the recording under way is; none if there is none.
  std::optional<RecordingResult> progress() const;

 private:
  void finish();
  void end();

  EventLoop& loop_;
  RecordingTap& tap_;
  std::unique_ptr<RecordingWriter> writer_;
  OnEnd on_end_;
};

}  // namespace loopd
