#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "base/result.h"
#include "events/client_connection.h"
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
  Status send(std::string_view bytes) { return connection_.send(bytes); }

  /// The next record, without its newline; none if `timeout` passed before it was complete, or as
  /// soon as `wake_fd` (if any) can be read. Errors: the connection has ended; a record longer
  /// than allowed.
  Result<std::optional<std::string>> next(std::chrono::milliseconds timeout, int wake_fd = -1) {
    return connection_.next(timeout, wake_fd);
  }

  int fd() const { return connection_.fd(); }

 private:
  explicit EventClient(ClientConnection connection) : connection_(std::move(connection)) {}

  ClientConnection connection_;
};

}  // namespace loopd
