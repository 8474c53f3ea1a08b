#pragma once

#include <string>

#include "base/result.h"
#include "base/unique_fd.h"

namespace loopd {

/// The sole right to make the socket at a path: a lock on `<path>.lock`, held for life, that the
/// kernel gives back however the process ends. Connecting to a socket tells whether somebody
/// listens, but not whether somebody else is about to. Move-only. Thread: one owner at a time.
class PathLock {
 public:
  /// Errors: EADDRINUSE if another process (or another lock of this one) has it; ENOENT if the
  /// folder is missing; permission.
  static Result<PathLock> take(const std::string& path);

  PathLock() = default;  ///< locks nothing
  PathLock(PathLock&&) noexcept = default;
  PathLock& operator=(PathLock&&) = delete;
  ~PathLock();

 private:
  PathLock(UniqueFd fd, std::string lock_path)
      : fd_(std::move(fd)), lock_path_(std::move(lock_path)) {}

  UniqueFd fd_;
  std::string lock_path_;
};

}  // namespace loopd
