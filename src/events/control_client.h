#pragma once

#include <chrono>
#include <deque>
#include <optional>
#include <string>
#include <utility>

#include "base/result.h"
#include "events/client_connection.h"
#include "events/control_request.h"

namespace loopd {

/// A connection to a daemon's control socket: asks one thing after the other, and waits for the
/// answers. Thread: one owner at a time. Move-only.
class ControlClient {
 public:
  /// Errors: no such path, nobody listening, no permission; each names the path and what to check.
  static Result<ControlClient> connect(const std::string& socket_path);

  /// Asks for `op` and waits for the answer, at most `timeout`: the text of the `ok` record.
  /// `limits` and `file` belong to ControlOp::kRecord: what bounds the recording, and a regular
  /// file open for writing (not for appending) that the daemon is to write it to; the caller keeps
  /// the descriptor, too. Errors: what the daemon says why not; the connection has ended; no answer
  /// in time (ETIMEDOUT), after which this connection is of no use.
  Result<std::string> request(ControlOp op, std::chrono::milliseconds timeout,
                              const RecordLimits& limits = {}, int file = -1);

  /// What the daemon tells later, like the `recorded` record; none if `timeout` passed, or as soon
  /// as `wake_fd` (if any) can be read. Errors: the connection has ended.
  Result<std::optional<std::string>> next(std::chrono::milliseconds timeout, int wake_fd = -1);

 private:
  explicit ControlClient(ClientConnection connection) : connection_(std::move(connection)) {}

  ClientConnection connection_;
  std::deque<std::string> later_;  ///< came while an answer was awaited
};

}  // namespace loopd
