#include <fcntl.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <optional>

#include "events/listening_socket.h"

namespace loopd {

namespace {

std::string what(const std::string& path) {
  return "cannot use the socket handed in for \"" + path + "\"";
}

int socket_option(int fd, int option) {
  int value = 0;
  socklen_t bytes = sizeof(value);
  return getsockopt(fd, SOL_SOCKET, option, &value, &bytes) == 0 ? value : -1;
}

/// The file a Unix socket is bound to; none if it is another kind of socket, none at all, unbound
/// or of the abstract name space.
std::optional<std::string> bound_path(int fd) {
  sockaddr_un address{};
  socklen_t bytes = sizeof(address);
  if (getsockname(fd, reinterpret_cast<sockaddr*>(&address), &bytes) != 0) return std::nullopt;
  constexpr std::size_t kBefore = offsetof(sockaddr_un, sun_path);
  if (address.sun_family != AF_UNIX || bytes <= kBefore || address.sun_path[0] == '\0') {
    return std::nullopt;
  }
  return std::string(
      address.sun_path,
      strnlen(address.sun_path, std::min<std::size_t>(bytes - kBefore, sizeof(address.sun_path))));
}

/// Whether both name the same file, be it through a link like /var/run.
bool is_same_file(const std::string& a, const std::string& b) {
  if (a == b) return true;
  struct stat file_a, file_b;
  return stat(a.c_str(), &file_a) == 0 && stat(b.c_str(), &file_b) == 0 &&
         file_a.st_dev == file_b.st_dev && file_a.st_ino == file_b.st_ino;
}

bool is_bound_to(const UniqueFd& fd, const std::string& path) {
  const std::optional<std::string> bound = bound_path(fd.get());
  return bound && is_same_file(*bound, path);
}

Status add_flags(int fd) {
  const int status = fcntl(fd, F_GETFL);
  if (status < 0 || fcntl(fd, F_SETFL, status | O_NONBLOCK) < 0 ||
      fcntl(fd, F_SETFD, FD_CLOEXEC) < 0) {
    return errno_error("cannot set the flags of the socket handed in", errno);
  }
  return Nothing();
}

}  // namespace

UniqueFd InheritedSockets::take(const std::string& path) {
  const auto it = std::find_if(fds_.begin(), fds_.end(),
                               [&](const UniqueFd& fd) { return is_bound_to(fd, path); });
  if (it == fds_.end()) return UniqueFd();
  UniqueFd taken = std::move(*it);
  fds_.erase(it);
  return taken;
}

std::vector<std::string> InheritedSockets::left() const {
  std::vector<std::string> names;
  for (const UniqueFd& fd : fds_) {
    names.push_back(bound_path(fd.get()).value_or("descriptor " + std::to_string(fd.get())));
  }
  return names;
}

Result<ListeningSocket> ListeningSocket::adopt(UniqueFd fd, const std::string& path, int type) {
  if (socket_option(fd.get(), SO_DOMAIN) != AF_UNIX) {
    return Error{what(path) + ": it is no Unix socket; see ListenStream= of the socket unit",
                 EINVAL};
  }
  if (socket_option(fd.get(), SO_TYPE) != type) {
    const bool stream = type == SOCK_STREAM;
    return Error{what(path) + ": it is of another type; use " +
                     (stream ? "ListenStream=" : "ListenSequentialPacket=") + " in the socket unit",
                 EINVAL};
  }
  if (socket_option(fd.get(), SO_ACCEPTCONN) != 1) {
    return Error{what(path) + ": it does not listen; the socket unit needs Accept=no", EINVAL};
  }
  if (!is_bound_to(fd, path)) {
    return Error{what(path) + ": it is bound to \"" + bound_path(fd.get()).value_or("no file") +
                     "\"; the paths in the config and in the socket unit must be the same",
                 EINVAL};
  }
  if (Status set = add_flags(fd.get()); !set) return set.error();
  return ListeningSocket(std::move(fd));
}

Result<ListeningSocket> ListeningSocket::open(const std::string& path, mode_t mode, int type,
                                              InheritedSockets* inherited) {
  UniqueFd fd = inherited != nullptr ? inherited->take(path) : UniqueFd();
  return fd.valid() ? adopt(std::move(fd), path, type) : bind(path, mode, type);
}

}  // namespace loopd
