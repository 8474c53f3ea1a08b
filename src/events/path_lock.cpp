#include "events/path_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <cerrno>
#include <utility>

namespace loopd {

namespace {

/// Each try but the last has met an owner that was just leaving.
constexpr int kTries = 100;

/// Whether `lock_path` still names the file that is locked: its last owner removes it on leaving.
bool is_still_named(const UniqueFd& fd, const std::string& lock_path) {
  struct stat locked, named;
  return fstat(fd.get(), &locked) == 0 && lstat(lock_path.c_str(), &named) == 0 &&
         locked.st_dev == named.st_dev && locked.st_ino == named.st_ino;
}

}  // namespace

Result<PathLock> PathLock::take(const std::string& path) {
  const std::string lock_path = path + ".lock";
  const std::string tried = "cannot lock \"" + lock_path + "\"";
  constexpr int kFlags = O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
  for (int i = 0; i < kTries; ++i) {
    UniqueFd fd(open(lock_path.c_str(), kFlags, 0600));
    if (!fd.valid()) return errno_error(tried, errno);
    if (flock(fd.get(), LOCK_EX | LOCK_NB) != 0) {
      if (errno == EINTR) continue;
      if (errno != EWOULDBLOCK) return errno_error(tried, errno);
      return Error{tried + ": another process holds it", EADDRINUSE};
    }
    if (is_still_named(fd, lock_path)) return PathLock(std::move(fd), lock_path);
  }
  return Error{tried + ": it is being removed again and again", EAGAIN};
}

PathLock::~PathLock() {
  // Removed while locked, so that nobody can have locked the file that goes.
  if (fd_.valid()) unlink(lock_path_.c_str());
}

}  // namespace loopd
