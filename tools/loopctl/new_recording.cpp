#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <utility>

#include "loopctl/record.h"

namespace loopd::loopctl {

namespace {

constexpr mode_t kMode = 0644;

/// Why a recording must not take the place of what is at `path`, if so.
Status check_replaceable(const std::string& path) {
  struct stat status {};
  if (lstat(path.c_str(), &status) != 0 || S_ISREG(status.st_mode)) return Nothing();
  return Error{"\"" + path + "\" is no regular file, so it is not replaced; choose another name",
               EEXIST};
}

Error create_error(const std::string& path, int code) {
  if (code == EEXIST) {
    return {"\"" + path + "\" is there already; choose another name, or replace it with --force",
            code};
  }
  return errno_error("cannot make the file \"" + path + "\"", code);
}

}  // namespace

Result<NewRecording> NewRecording::create(const std::string& path, bool replace) {
  if (replace) {
    if (const Status checked = check_replaceable(path); !checked) return checked.error();
  }
  // Beside the old one, in the same folder, so that taking its place is one step.
  std::string made = replace ? path + "." + std::to_string(getpid()) + ".part" : path;
  UniqueFd fd(open(made.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kMode));
  if (!fd.valid()) return create_error(made, errno);
  return NewRecording(std::move(fd), path, std::move(made));
}

NewRecording::~NewRecording() {
  if (!made_.empty()) unlink(made_.c_str());
}

NewRecording::NewRecording(NewRecording&& other) noexcept
    : fd_(std::move(other.fd_)),
      path_(std::move(other.path_)),
      made_(std::exchange(other.made_, {})) {}

Status NewRecording::keep() {
  if (made_ != path_ && rename(made_.c_str(), path_.c_str()) != 0) {
    return errno_error("cannot put the recording in the place of \"" + path_ + "\"", errno);
  }
  made_.clear();
  return Nothing();
}

}  // namespace loopd::loopctl
