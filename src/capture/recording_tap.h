#pragma once

#include <mutex>

#include "capture/recording_writer.h"
#include "loopd/frame.h"

namespace loopd {

/// Where the main thread puts a RecordingWriter for the capture thread to find.
///
/// Use: the capture thread calls offer() for every frame; the main thread calls start() and, before
/// the writer is destroyed, stop(). Thread: thread-safe.
class RecordingTap {
 public:
  /// From now on frames go to `writer`, which lives until stop() has returned.
  void start(RecordingWriter& writer) {
    const std::lock_guard lock(mutex_);
    writer_ = &writer;
  }

  /// From now on frames go nowhere. Returns once no offer() uses the writer any more: at most as
  /// long as the copy of a frame takes.
  void stop() {
    const std::lock_guard lock(mutex_);
    writer_ = nullptr;
  }

  /// Hands a frame on, if there is anybody to take it. Never waits: in the instant in which the
  /// main thread starts or stops a recording, the frame is before its start or after its end.
  void offer(const Frame& frame) {
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (lock.owns_lock() && writer_ != nullptr)
      writer_->offer(frame.view(), frame.sequence, frame.time_ns);
  }

 private:
  std::mutex mutex_;
  RecordingWriter* writer_ = nullptr;  ///< guarded by mutex_
};

}  // namespace loopd
