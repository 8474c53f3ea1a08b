#pragma once

#include <sys/stat.h>
#include <sys/un.h>

#include <string>

#include "base/result.h"
#include "base/unique_fd.h"

namespace loopd {

/// The address of the Unix socket at `path`; an error if it is empty, longer than the kernel takes
/// or holds a NUL byte.
Result<sockaddr_un> unix_address(const std::string& path);

/// A non-blocking Unix stream socket that listens, and the file it is reached by. The file is
/// removed on destruction if it is still the same one. Move-only. Thread: one owner at a time.
class ListeningSocket {
 public:
  /// Binds to `path`, replacing the file of a daemon that is gone. Errors: see unix_address();
  /// folder missing; something else than a socket at `path` (never deleted); a live daemon there.
  static Result<ListeningSocket> bind(const std::string& path, mode_t mode);

  ListeningSocket(ListeningSocket&& other) noexcept;
  ListeningSocket& operator=(ListeningSocket&&) = delete;
  ~ListeningSocket();

  int fd() const { return fd_.get(); }

 private:
  ListeningSocket(UniqueFd fd, std::string path, const struct stat& file);

  UniqueFd fd_;
  std::string path_;  ///< empty: no file of ours (moved from, or a socket handed in)
  dev_t device_ = 0;
  ino_t inode_ = 0;
};

}  // namespace loopd
