#include "events/client_connection.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
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
      return {tried + ": permission denied; check the modes of the socket and of its folders, and" +
                  " your groups",
              code};
    default:
      return errno_error(tried, code);
  }
}

}  // namespace

Result<ClientConnection> ClientConnection::connect(const std::string& socket_path,
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
  return ClientConnection(std::move(fd), socket_path, max_record_bytes);
}

Status ClientConnection::send(std::string_view bytes, int passed_fd) {
  while (!bytes.empty()) {
    const ssize_t sent = send_some(bytes, passed_fd);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) return errno_error("cannot send to loopd at \"" + path_ + "\"", errno);
    bytes.remove_prefix(static_cast<std::size_t>(sent));
    passed_fd = -1;  // it went with the first byte
  }
  return Nothing();
}

ssize_t ClientConnection::send_some(std::string_view bytes, int passed_fd) const {
  if (passed_fd < 0) return ::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
  iovec part{const_cast<char*>(bytes.data()), bytes.size()};  // iovec has no const form
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  cmsghdr* header = CMSG_FIRSTHDR(&message);
  header->cmsg_level = SOL_SOCKET;
  header->cmsg_type = SCM_RIGHTS;
  header->cmsg_len = CMSG_LEN(sizeof(int));
  std::memcpy(CMSG_DATA(header), &passed_fd, sizeof(passed_fd));
  return sendmsg(fd_.get(), &message, MSG_NOSIGNAL);
}

Result<std::optional<std::string>> ClientConnection::next(std::chrono::milliseconds timeout,
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

Result<ClientConnection::Wait> ClientConnection::wait_until(
    std::chrono::steady_clock::time_point deadline, int wake_fd) const {
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

Status ClientConnection::receive() {
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
