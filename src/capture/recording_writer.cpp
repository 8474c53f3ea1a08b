#include "capture/recording_writer.h"

#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <exception>
#include <new>
#include <utility>

#include "base/clock.h"
#include "capture/fault_script.h"

namespace loopd {
namespace {

std::int64_t realtime_now_ns() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

std::optional<std::int64_t> deadline_of(const RecordingLimits& limits) {
  if (!limits.duration_ns) return std::nullopt;
  return saturating_add(monotonic_now_ns(), *limits.duration_ns);
}

Status check(const RecordingOptions& options) {
  const RecordingLimits& limits = options.limits;
  std::string problems;
  if (limits.duration_ns && *limits.duration_ns < 1) problems += "; the duration must be above 0";
  if (limits.frames && *limits.frames < 1) problems += "; the number of frames must be above 0";
  if (limits.bytes < kRecordingFileHeaderBytes)
    problems += "; the size must be at least the 256 bytes of the file's header";
  if (options.buffer_bytes < kRecordingSmallestRecordBytes)
    problems += "; the buffer must be at least 128 bytes";
  if (problems.empty()) return Nothing{};
  return Error{"cannot record: " + problems.substr(2), EINVAL};
}

}  // namespace

std::string_view recording_end_name(RecordingEnd end) {
  switch (end) {
    case RecordingEnd::kStopped:
      return "stopped";
    case RecordingEnd::kTime:
      return "time";
    case RecordingEnd::kSize:
      return "size";
    case RecordingEnd::kFrames:
      return "frames";
    case RecordingEnd::kDiskFull:
      return "disk_full";
    case RecordingEnd::kWriteError:
      break;
  }
  return "write_error";
}

Result<std::unique_ptr<RecordingWriter>> RecordingWriter::start(UniqueFd file,
                                                                const RecordingOptions& options) {
  auto output = open_recording_output(std::move(file), options.limits.keep_free_bytes);
  if (!output.ok()) return output.error();
  return start(std::move(output).value(), options);
}

Result<std::unique_ptr<RecordingWriter>> RecordingWriter::start(
    std::unique_ptr<RecordingOutput> output, const RecordingOptions& options) {
  if (const Status checked = check(options); !checked.ok()) return checked.error();
  UniqueFd finished(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (!finished.valid()) return errno_error("cannot record: no eventfd to be had", errno);
  std::unique_ptr<RecordingWriter> writer;
  try {
    writer.reset(new RecordingWriter(std::move(output), options, std::move(finished)));
  } catch (const std::bad_alloc&) {
    return Error{"cannot record: no memory for a buffer of " +
                     std::to_string(options.buffer_bytes >> 20) + " MiB; choose a smaller one",
                 ENOMEM};
  }
  Result<NamedThread> thread = NamedThread::start(
      options.thread, [self = writer.get()] { self->run(); },
      [self = writer.get()](const std::string&, std::exception_ptr) { self->give_up(); });
  if (!thread.ok()) return thread.error();
  writer->thread_ = std::move(thread).value();
  return writer;
}

RecordingWriter::RecordingWriter(std::unique_ptr<RecordingOutput> output,
                                 const RecordingOptions& options, UniqueFd finished)
    : options_(options),
      output_(std::move(output)),
      finished_(std::move(finished)),
      deadline_ns_(deadline_of(options.limits)),
      buffer_(options.buffer_bytes) {}

RecordingWriter::~RecordingWriter() { stop(); }

RecordingResult RecordingWriter::result() const {
  const std::lock_guard lock(mutex_);
  RecordingResult result = result_;
  result.lost = buffer_.lost();
  return result;
}

void RecordingWriter::run() {
  RecordingEnd end = record();
  buffer_.close();
  if (end == RecordingEnd::kDiskFull || end == RecordingEnd::kWriteError) buffer_.lose_all();
  const Status flushed = output_->finish();
  if (!flushed.ok()) end = fail(flushed.error());
  finish(end);
}

// Writes frames until there is a reason not to.
RecordingEnd RecordingWriter::record() {
  if (const auto end = write_header()) return *end;
  RecordingEnd end_when_empty = RecordingEnd::kStopped;
  while (true) {
    if (deadline_ns_ && monotonic_now_ns() >= *deadline_ns_) {
      end_when_empty = RecordingEnd::kTime;
      stop();
    }
    const std::optional<RecordingBuffer::Item> item = buffer_.front(deadline_ns_);
    if (item) {
      if (const auto end = write(*item)) return *end;
      buffer_.pop();
    } else if (buffer_.closed()) {
      return end_when_empty;
    }
  }
}

std::optional<RecordingEnd> RecordingWriter::write_header() {
  const RecordingInfo info{.camera = options_.camera,
                           .loopd_version = options_.loopd_version,
                           .boot_id = options_.boot_id,
                           .started_realtime_ns = realtime_now_ns(),
                           .started_monotonic_ns = monotonic_now_ns()};
  return append(encode_recording_info(info), 0);
}

std::optional<RecordingEnd> RecordingWriter::write(const RecordingBuffer::Item& item) {
  const RecordingResult& so_far = result_;  // written by this thread only
  if (options_.limits.bytes - so_far.bytes < item.record.size()) return RecordingEnd::kSize;
  RecordedFrame frame = item.frame;
  frame.number = so_far.frames;
  frame.pixels_crc =
      recording_crc(item.record.subspan(kRecordingFrameHeaderBytes).first(frame.size.pixels()));
  std::ranges::copy(encode_recorded_frame(frame), item.record.begin());
  if (const auto end = append(item.record, 1)) return end;
  if (options_.limits.frames == so_far.frames) return RecordingEnd::kFrames;
  return std::nullopt;
}

std::optional<RecordingEnd> RecordingWriter::append(std::span<const std::uint8_t> bytes,
                                                    std::uint64_t frames) {
  const Status status = output_->append(bytes);
  if (!status.ok()) return fail(status.error());
  const std::lock_guard lock(mutex_);
  result_.bytes += bytes.size();
  result_.frames += frames;
  return std::nullopt;
}

// The first failure is the one that is told.
RecordingEnd RecordingWriter::fail(const Error& error) {
  const std::lock_guard lock(mutex_);
  if (result_.message.empty()) {
    result_.message = error.message;
    result_.code = error.code;
  }
  const bool full = result_.code == ENOSPC || result_.code == EDQUOT;
  return full ? RecordingEnd::kDiskFull : RecordingEnd::kWriteError;
}

// After an exception, which can only be that there was no memory for a message.
void RecordingWriter::give_up() {
  buffer_.close();
  {
    const std::lock_guard lock(mutex_);
    result_.code = ENOMEM;
  }
  finish(RecordingEnd::kWriteError);
}

void RecordingWriter::finish(RecordingEnd end) {
  {
    const std::lock_guard lock(mutex_);
    result_.end = end;
  }
  const std::uint64_t one = 1;
  // Cannot fail: the counter is far from full.
  [[maybe_unused]] const ssize_t written = ::write(finished_.get(), &one, sizeof one);
}

}  // namespace loopd
