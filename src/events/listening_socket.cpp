#include "events/listening_socket.h"

#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

namespace loopd {

namespace {

std::string what(const std::string& path) { return "cannot listen on socket \"" + path + "\""; }

const sockaddr* generic(const sockaddr_un& address) {
  return reinterpret_cast<const sockaddr*>(&address);
}

Error missing_folder(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  return {what(path) + ": its folder \"" + folder +
              "\" does not exist; create it, or let systemd do so (RuntimeDirectory=)",
          ENOENT};
}

Error in_use(const std::string& path) {
  return {what(path) + ": a running daemon uses it; stop that one or choose another path",
          EADDRINUSE};
}

Result<PathLock> lock_path(const std::string& path) {
  Result<PathLock> lock = PathLock::take(path);
  if (lock) return lock;
  if (lock.error().code == EADDRINUSE) return in_use(path);
  if (lock.error().code == ENOENT) return missing_folder(path);
  return Error{what(path) + ": " + lock.error().message, lock.error().code};
}

/// Whether the socket file at `path` has no one behind it. A live one is an error.
Result<bool> is_stale(const std::string& path, const sockaddr_un& address, int type) {
  UniqueFd probe(socket(AF_UNIX, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!probe.valid()) return errno_error(what(path) + ": no socket to be had", errno);
  if (connect(probe.get(), generic(address), sizeof(address)) == 0 || errno == EAGAIN) {
    return in_use(path);
  }
  if (errno == ECONNREFUSED) return true;
  if (errno == ENOENT) return false;  // its owner has just removed it
  if (errno == EPROTOTYPE) {
    return Error{what(path) + ": another program's socket of another type is there", EADDRINUSE};
  }
  return errno_error(what(path) + ": cannot tell whether the socket there is in use", errno);
}

/// Makes room at `path` for a socket file of ours.
Status clear_path(const std::string& path, const sockaddr_un& address, int type) {
  struct stat file;
  if (lstat(path.c_str(), &file) != 0) {
    if (errno == ENOENT) return Nothing();  // bind() tells if it is the folder that is missing
    return errno_error(what(path), errno);
  }
  if (!S_ISSOCK(file.st_mode)) {
    return Error{what(path) + ": something that is not a socket is there; move it away", EEXIST};
  }
  const Result<bool> stale = is_stale(path, address, type);
  if (!stale) return stale.error();
  if (stale.value() && unlink(path.c_str()) != 0 && errno != ENOENT) {
    return errno_error(what(path) + ": cannot remove the stale socket file there", errno);
  }
  return Nothing();
}

}  // namespace

Result<sockaddr_un> unix_address(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  constexpr std::size_t kMaxBytes = sizeof(address.sun_path) - 1;
  if (path.empty()) return Error{"the socket path is empty", EINVAL};
  if (path.find('\0') != std::string::npos) return Error{"the socket path holds a NUL", EINVAL};
  if (path.size() > kMaxBytes) {
    return Error{"socket path \"" + path + "\" is " + std::to_string(path.size()) +
                     " bytes long; the kernel takes at most " + std::to_string(kMaxBytes),
                 ENAMETOOLONG};
  }
  std::memcpy(address.sun_path, path.data(), path.size());
  return address;
}

std::string seqpacket_path(const std::string& stream_path) {
  return std::filesystem::path(stream_path).replace_extension(".seqpacket").string();
}

Result<ListeningSocket> ListeningSocket::bind(const std::string& path, mode_t mode, int type) {
  const Result<sockaddr_un> address = unix_address(path);
  if (!address) return address.error();
  Result<PathLock> lock = lock_path(path);
  if (!lock) return lock.error();
  if (Status clear = clear_path(path, address.value(), type); !clear) return clear.error();
  UniqueFd fd(socket(AF_UNIX, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!fd.valid()) return errno_error(what(path) + ": no socket to be had", errno);
  if (::bind(fd.get(), generic(address.value()), sizeof(sockaddr_un)) != 0) {
    if (errno == ENOENT) return missing_folder(path);
    return errno_error(what(path), errno);
  }
  struct stat file;
  if (lstat(path.c_str(), &file) != 0) return errno_error(what(path), errno);
  ListeningSocket socket(std::move(lock).value(), std::move(fd), path, file);
  if (chmod(path.c_str(), mode) != 0) return errno_error(what(path) + ": cannot chmod it", errno);
  if (::listen(socket.fd(), SOMAXCONN) != 0) return errno_error(what(path), errno);
  return socket;
}

ListeningSocket::ListeningSocket(PathLock lock, UniqueFd fd, std::string path,
                                 const struct stat& file)
    : lock_(std::move(lock)),
      fd_(std::move(fd)),
      path_(std::move(path)),
      device_(file.st_dev),
      inode_(file.st_ino) {}

ListeningSocket::ListeningSocket(ListeningSocket&& other) noexcept
    : lock_(std::move(other.lock_)),
      fd_(std::move(other.fd_)),
      path_(std::exchange(other.path_, {})),
      device_(other.device_),
      inode_(other.inode_) {}

ListeningSocket::~ListeningSocket() {
  struct stat file;
  if (path_.empty() || lstat(path_.c_str(), &file) != 0) return;
  if (file.st_dev == device_ && file.st_ino == inode_) unlink(path_.c_str());
}

}  // namespace loopd
