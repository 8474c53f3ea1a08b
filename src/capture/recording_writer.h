#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/thread.h"
#include "base/unique_fd.h"
#include "capture/recording_buffer.h"
#include "capture/recording_format.h"
#include "capture/recording_output.h"
#include "loopd/frame.h"

namespace loopd {

/// Why a recording ended.
enum class RecordingEnd : std::uint8_t {
  kStopped,     ///< stop() was called
  kTime,        ///< it lasted as long as it may
  kSize,        ///< the next frame would make the file longer than it may be
  kFrames,      ///< it has as many frames as it may
  kDiskFull,    ///< there is no room on the disk, or not beside what is to be kept free
  kWriteError,  ///< writing failed for another reason; message and code say which
};

/// Stable lower-case name: "stopped", "time", "size", "frames", "disk_full", "write_error".
std::string_view recording_end_name(RecordingEnd end);

/// When a recording ends by itself.
struct RecordingLimits {
  std::optional<std::int64_t> duration_ns = {};  ///< from start() on, frames or not; >= 1
  std::uint64_t bytes = std::uint64_t{1} << 30;  ///< of the file; never longer; >= 256
  std::optional<std::uint64_t> frames = {};      ///< >= 1
  /// What must stay free on the file system for others.
  std::uint64_t keep_free_bytes = std::uint64_t{128} << 20;
};

/// How to record.
struct RecordingOptions {
  std::string camera = {};         ///< its name, for the file's header
  std::string loopd_version = {};  ///< the same
  std::string boot_id = {};        ///< the same
  RecordingLimits limits = {};
  /// Memory for frames on their way to the disk, taken at the start. A disk that takes longer than
  /// it lasts costs frames: 32 MiB are 3.6 s of 640x480 at 30 fps. Best several times the largest
  /// frame; a frame that does not fit into it at all is lost.
  std::size_t buffer_bytes = std::size_t{32} << 20;
  ThreadOptions thread = {.name = "record"};
};

/// What a recording has come to, so far or in the end.
struct RecordingResult {
  std::uint64_t frames = 0;  ///< in the file
  std::uint64_t bytes = 0;   ///< of the file
  std::uint64_t lost = 0;    ///< offered, but not in the file: the disk was too slow, or failed
  std::optional<RecordingEnd> end = {};  ///< none: it goes on
  std::string message = {};              ///< one sentence on kDiskFull and kWriteError, else empty
  int code = 0;                          ///< errno behind it, 0 if none
};

/// Writes what a camera gives into a file (see recording_format.h), on a thread of its own.
///
/// Thread: offer() by one thread at a time; everything else by any.
class RecordingWriter {
 public:
  /// Starts to record into `file`, an empty regular file open for writing. Nothing of it touches
  /// the disk: also the file's header is written by the thread. Errors: the file cannot be used,
  /// limits or buffer out of range, no memory, no thread.
  static Result<std::unique_ptr<RecordingWriter>> start(UniqueFd file,
                                                        const RecordingOptions& options);

  /// The same with an output made by the caller (tests), which keeps no space free.
  static Result<std::unique_ptr<RecordingWriter>> start(std::unique_ptr<RecordingOutput> output,
                                                        const RecordingOptions& options);

  /// Stops, and waits until what was offered is on the disk or has failed: so best destroyed once
  /// finished_fd() is readable.
  ~RecordingWriter();
  RecordingWriter(const RecordingWriter&) = delete;
  RecordingWriter& operator=(const RecordingWriter&) = delete;

  /// Copies a frame into the buffer and returns at once: it waits for no disk and allocates
  /// nothing. A frame without room is lost and counted; once the recording has ended it does
  /// nothing. Cost: the copy.
  void offer(const LumaView& view, std::uint64_t sequence, std::optional<std::int64_t> time_ns) {
    buffer_.put(view, sequence, time_ns);
  }

  /// Ends the recording; returns at once. What was offered before is still written.
  void stop() { buffer_.close(); }

  /// What there is so far; `end` is set as soon as finished_fd() is readable, and then for good.
  RecordingResult result() const;

  /// Becomes readable, for good, when the recording has ended, by whatever cause. For poll; do not
  /// read from it.
  int finished_fd() const { return finished_.get(); }

  /// What options.thread asked for and could not be had.
  const std::vector<Error>& shortfalls() const { return thread_.shortfalls(); }

 private:
  RecordingWriter(std::unique_ptr<RecordingOutput> output, const RecordingOptions& options,
                  UniqueFd finished);

  void run();
  RecordingEnd record();
  std::optional<RecordingEnd> write_header();
  std::optional<RecordingEnd> write(const RecordingBuffer::Item& item);
  std::optional<RecordingEnd> append(std::span<const std::uint8_t> bytes, std::uint64_t frames);
  RecordingEnd fail(const Error& error);
  void give_up();
  void finish(RecordingEnd end);

  const RecordingOptions options_;
  const std::unique_ptr<RecordingOutput> output_;
  const UniqueFd finished_;                        ///< eventfd
  const std::optional<std::int64_t> deadline_ns_;  ///< CLOCK_MONOTONIC
  RecordingBuffer buffer_;
  mutable std::mutex mutex_;
  RecordingResult result_;  ///< guarded by mutex_; `lost` is the buffer's
  NamedThread thread_;      ///< last, so that it is joined before the rest goes
};

}  // namespace loopd
