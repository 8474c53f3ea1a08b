#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>

#include "base/result.h"
#include "base/unique_fd.h"
#include "events/line_buffer.h"
#include "events/records.h"

namespace loopd {

/// A connection to a daemon's event socket: asks, and reads records line by line.
/// Thread: one owner at a time. Move-only.
class EventClient {
 public:
  static constexpr std::size_t kMaxRecordBytes = 4 * 1024 * 1024;

  /// Errors: no such path, nobody listening, no permission; each names the path and what to check.
  static Result<EventClient> connect(const std::string& socket_path,
                                     std::size_t max_record_bytes = kMaxRecordBytes);

  /// Asks for records; the answer, a `watch` or an `error` record, comes by next(). So does the
  /// reason if the daemon has closed the connection already ("too many clients").
  Status watch(const WatchRequest& request);
  /// Sends `bytes` as they are. Blocks while the daemon does not read, at most a second.
  Status send(std::string_view bytes);

  /// The next record, without its newline; none if `timeout` passed before it was complete, or as
  /// soon as `wake_fd` (if any) can be read. Errors: the connection has ended; a record longer
  /// than allowed.
  Result<std::optional<std::string>> next(std::chrono::milliseconds timeout, int wake_fd = -1);

  int fd() const { return fd_.get(); }

 private:
  enum class Wait { kReadable, kNothing };
  EventClient(UniqueFd fd, std::string path, std::size_t max_record_bytes)
      : fd_(std::move(fd)), path_(std::move(path)), lines_(max_record_bytes) {}
  Result<Wait> wait_until(std::chrono::steady_clock::time_point deadline, int wake_fd) const;
  Status receive();

  UniqueFd fd_;
  std::string path_;
  LineBuffer lines_;
};

}  // namespace loopd
