#pragma once

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "base/unique_fd.h"

namespace loopd::testing {

/// Stands in for systemd: the socket that sd_notify(3) sends to.
class NotifySocket {
 public:
  explicit NotifySocket(const std::string& path)
      : path_(path), fd_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.size() >= sizeof address.sun_path) throw std::runtime_error("path too long");
    std::copy(path.begin(), path.end(), std::begin(address.sun_path));
    const auto* generic = reinterpret_cast<const sockaddr*>(&address);
    if (bind(fd_.get(), generic, sizeof address) != 0) throw std::runtime_error("cannot bind");
  }

  std::string environment() const { return "NOTIFY_SOCKET=" + path_; }

  /// Reads messages until one holds the line `line` or begins with it if that ends in '='; false
  /// if none comes in a minute.
  bool wait_for(std::string_view line) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    while (true) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
          deadline - std::chrono::steady_clock::now());
      pollfd readable{fd_.get(), POLLIN, 0};
      if (left.count() <= 0 || poll(&readable, 1, static_cast<int>(left.count())) != 1)
        return false;
      if (receive(line)) return true;
    }
  }

  /// Reads what is there now; true if a message holds `line` as above.
  bool has(std::string_view line) {
    pollfd readable{fd_.get(), POLLIN, 0};
    bool found = false;
    while (poll(&readable, 1, 0) == 1) found = receive(line) || found;
    return found;
  }

 private:
  bool receive(std::string_view line) {
    std::array<char, 4096> buffer{};
    const ssize_t size = recv(fd_.get(), buffer.data(), buffer.size(), 0);
    const std::string_view text(buffer.data(), size > 0 ? static_cast<std::size_t>(size) : 0);
    return line.ends_with('=') ? text.starts_with(line) : text == line;
  }

  std::string path_;
  UniqueFd fd_;
};

}  // namespace loopd::testing
