#include "events/client.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "events/listening_socket.h"

namespace loopd {

namespace {

constexpr std::size_t kReadBytes = 64 * 1024;
constexpr timeval kSendTimeout{.tv_sec = 1, .tv_usec = 0};

Error connect_error(const std::string& path, int code) {
  const std::string tried = "cannot connect to loopd at \"" + path + "\"";
  switch (code) {
    case ENOENT:
      return {tried + ": there is no such socket; is the daemon running for this camera?", code};
    case ECONNREFUSED:
      return {tried + ": nobody listens there; the daemon has ended without cleaning up", code};
    case EACCES:
      return {tried + ": permission denied; check the mode of the folders above it", code};
    default:
      return errno_error(tried, code);
  }
}

}  // namespace

Result<EventClient> EventClient::connect(const std::string& socket_path,
                                         std::size_t max_record_bytes) {
  const Result<sockaddr_un> address = unix_address(socket_path);
  if (!address) return address.error();
  UniqueFd fd(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (!fd.valid()) return connect_error(socket_path, errno);
  setsockopt(fd.get(), SOL_SOCKET, SO_SNDTIMEO, &kSendTimeout, sizeof(kSendTimeout));
  const auto* generic = reinterpret_cast<const sockaddr*>(&address.value());
  if (::connect(fd.get(), generic, sizeof(sockaddr_un)) != 0) {
    return connect_error(socket_path, errno);
  }
  return EventClient(std::move(fd), socket_path, max_record_bytes);
}

Status EventClient::watch(const WatchRequest& request) {
  Status sent = send(request_text(request) + "\n");
  if (!sent && sent.error().code == EPIPE) return Nothing();
  return sent;
}

Status EventClient::send(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) return errno_error("cannot send to loopd at \"" + path_ + "\"", errno);
    bytes.remove_prefix(static_cast<std::size_t>(sent));
  }
  return Nothing();
}

Result<std::optional<std::string>> EventClient::next(std::chrono::milliseconds timeout,
                                                     int wake_fd) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (true) {
    std::string line;
    switch (lines_.next(line)) {
      case LineBuffer::Next::kLine:
        return std::optional(std::move(line));
      case LineBuffer::Next::kTooLong:
        return Error{"loopd at \"" + path_ + "\" sent a record longer than allowed", EMSGSIZE};
      case LineBuffer::Next::kNone:
        break;
    }
    const Result<Wait> wait = wait_until(deadline, wake_fd);
    if (!wait) return wait.error();
    if (wait.value() == Wait::kNothing) return std::optional<std::string>();
    if (Status status = receive(); !status) return status.error();
  }
}

Result<EventClient::Wait> EventClient::wait_until(std::chrono::steady_clock::time_point deadline,
                                                  int wake_fd) const {
  using std::chrono::milliseconds;
  std::array<pollfd, 2> fds{{{fd_.get(), POLLIN, 0}, {wake_fd, POLLIN, 0}}};
  while (true) {
    const auto left = std::chrono::ceil<milliseconds>(deadline - std::chrono::steady_clock::now());
    const int left_ms = static_cast<int>(std::clamp<std::int64_t>(left.count(), 0, 1 << 30));
    const int ready = poll(fds.data(), fds.size(), left_ms);
    if (ready < 0 && errno == EINTR) continue;
    if (ready < 0) return errno_error("cannot wait for loopd at \"" + path_ + "\"", errno);
    const bool readable = ready > 0 && fds[1].revents == 0;
    return readable ? Wait::kReadable : Wait::kNothing;
  }
}

Status EventClient::receive() {
  std::array<char, kReadBytes> bytes;
  const ssize_t n = recv(fd_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (n > 0) {
    lines_.append({bytes.data(), static_cast<std::size_t>(n)});
    return Nothing();
  }
  if (n < 0 && (errno == EAGAIN || errno == EINTR)) return Nothing();
  const int code = n == 0 ? 0 : errno;
  return Error{"loopd at \"" + path_ + "\" has closed the connection", code};
}

}  // namespace loopd
