#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "base/result.h"
#include "base/unique_fd.h"
#include "events/line_buffer.h"

namespace loopd {

/// A connection to one of the daemon's stream sockets: sends bytes, reads records line by line.
/// What EventClient and ControlClient share. Thread: one owner at a time. Move-only.
class ClientConnection {
 public:
  /// Errors: no such path, nobody listening, no permission; each names the path and what to check.
  static Result<ClientConnection> connect(const std::string& socket_path,
                                          std::size_t max_record_bytes);

  /// Sends `bytes` as they are, and a file descriptor with them if one is given, which stays the
  /// caller's. Blocks while the daemon does not read, at most a second.
  Status send(std::string_view bytes, int passed_fd = -1);

  /// The next record, without its newline; none if `timeout` passed before it was complete, or as
  /// soon as `wake_fd` (if any) can be read. Errors: the connection has ended; a record longer
  /// than allowed.
  Result<std::optional<std::string>> next(std::chrono::milliseconds timeout, int wake_fd = -1);

  int fd() const { return fd_.get(); }
  const std::string& path() const { return path_; }

 private:
  enum class Wait { kReadable, kNothing };
  ClientConnection(UniqueFd fd, std::string path, std::size_t max_record_bytes)
      : fd_(std::move(fd)), path_(std::move(path)), lines_(max_record_bytes) {}
  Result<Wait> wait_until(std::chrono::steady_clock::time_point deadline, int wake_fd) const;
  ssize_t send_some(std::string_view bytes, int passed_fd) const;
  Status receive();

  UniqueFd fd_;
  std::string path_;
  LineBuffer lines_;
};

}  // namespace loopd
