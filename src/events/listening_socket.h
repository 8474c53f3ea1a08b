#pragma once

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <string>
#include <vector>

#include "base/result.h"
#include "base/unique_fd.h"
#include "events/path_lock.h"

namespace loopd {

/// The address of the Unix socket at `path`; an error if it is empty, longer than the kernel takes
/// or holds a NUL byte.
Result<sockaddr_un> unix_address(const std::string& path);

/// The path of the packet socket that belongs to a stream socket: its extension replaced,
/// "/run/loopd/front/events.sock" -> "/run/loopd/front/events.seqpacket".
std::string seqpacket_path(const std::string& stream_path);

/// Listening sockets that the service manager made and handed over (LISTEN_FDS), which outlive the
/// daemon: a client that connects while it restarts waits instead of failing. Move-only. Thread:
/// one owner at a time.
class InheritedSockets {
 public:
  InheritedSockets() = default;
  explicit InheritedSockets(std::vector<UniqueFd> fds) : fds_(std::move(fds)) {}

  /// The one that is bound to `path`, given away; invalid if there is none.
  UniqueFd take(const std::string& path);
  /// What the ones not taken are bound to (or what else they are), for a warning: nobody serves
  /// them. They are closed with this object.
  std::vector<std::string> left() const;

 private:
  std::vector<UniqueFd> fds_;
};

/// A non-blocking Unix socket (SOCK_STREAM or SOCK_SEQPACKET) that listens, and, if it was made
/// here, the file it is reached by. Move-only. Thread: one owner at a time.
class ListeningSocket {
 public:
  /// Binds to `path` and locks it (PathLock), replacing the file of a daemon that is gone. The file
  /// is removed on destruction if it is still the same one. Errors: see unix_address(); folder
  /// missing; something else than a socket at `path` (never deleted); a live daemon there.
  static Result<ListeningSocket> bind(const std::string& path, mode_t mode, int type = SOCK_STREAM);

  /// Takes over a socket that somebody else made; sets O_NONBLOCK and FD_CLOEXEC. Its file is never
  /// removed. Errors: not a listening Unix socket of `type`; bound to something else than `path`.
  static Result<ListeningSocket> adopt(UniqueFd fd, const std::string& path,
                                       int type = SOCK_STREAM);

  /// adopt()s the inherited socket for `path` if there is one, else bind()s.
  static Result<ListeningSocket> open(const std::string& path, mode_t mode, int type,
                                      InheritedSockets* inherited);

  ListeningSocket(ListeningSocket&& other) noexcept;
  ListeningSocket& operator=(ListeningSocket&&) = delete;
  ~ListeningSocket();

  int fd() const { return fd_.get(); }

 private:
  ListeningSocket(PathLock lock, UniqueFd fd, std::string path, const struct stat& file);
  explicit ListeningSocket(UniqueFd fd) : fd_(std::move(fd)) {}

  PathLock lock_;  ///< first: given back after the file is removed
  UniqueFd fd_;
  std::string path_;  ///< empty: no file of ours (moved from, or a socket handed in)
  dev_t device_ = 0;
  ino_t inode_ = 0;
};

}  // namespace loopd
