#include "app/recorder.h"

#include <poll.h>

#include <cerrno>
#include <utility>

namespace loopd {

Status Recorder::start(UniqueFd file, const RecordingOptions& options, OnEnd on_end) {
  if (writer_) return Error{"cannot record: a recording is under way; stop it first", EBUSY};
  auto writer = RecordingWriter::start(std::move(file), options);
  if (!writer) return writer.error();
  const Status watched = loop_.on_readable(writer.value()->finished_fd(), [this] { finish(); });
  if (!watched) return watched;
  writer_ = std::move(writer).value();
  on_end_ = std::move(on_end);
  tap_.start(*writer_);
  return Nothing{};
}

void Recorder::stop() {
  if (writer_) writer_->stop();
}

void Recorder::finish_now() {
  if (!writer_) return;
  writer_->stop();
  pollfd finished{writer_->finished_fd(), POLLIN, 0};
  while (poll(&finished, 1, -1) < 0 && errno == EINTR) {
  }
  finish();
}

std::optional<RecordingResult> Recorder::progress() const {
  if (!writer_) return std::nullopt;
  return writer_->result();
}

/// The writer has ended: tells so.
void Recorder::finish() {
  const RecordingResult result = writer_->result();
  const OnEnd on_end = std::move(on_end_);
  end();
  on_end(result);
}

void Recorder::end() {
  if (!writer_) return;
  tap_.stop();
  loop_.forget(writer_->finished_fd());
  writer_.reset();
}

}  // namespace loopd
