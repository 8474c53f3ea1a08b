#include "capture/read_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "base/unique_fd.h"

namespace loopd {
namespace {

Error cannot_read(const std::string& path, int code) {
  return errno_error("cannot read " + path, code);
}

Error too_long(const std::string& path, std::size_t max_bytes) {
  return {"cannot read " + path + ": it is longer than the " + std::to_string(max_bytes) +
              " bytes that an image of camera.max_pixels can need",
          EFBIG};
}

}  // namespace

Status read_regular_file(const std::string& path, std::size_t max_bytes,
                         std::vector<std::uint8_t>& bytes) {
  // O_NONBLOCK: opening a pipe or a device must not wait for its other side.
  const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  if (!fd.valid()) return cannot_read(path, errno);
  struct stat status {};
  if (::fstat(fd.get(), &status) != 0) return cannot_read(path, errno);
  if (!S_ISREG(status.st_mode))
    return Error{"cannot read " + path + ": it is a " +
                     (S_ISDIR(status.st_mode) ? "folder" : "pipe, socket or device") +
                     ", not a file",
                 ENOTSUP};
  if (static_cast<std::uint64_t>(status.st_size) > max_bytes) return too_long(path, max_bytes);

  // One byte more than announced, so that a file that grew meanwhile is read to its end.
  bytes.resize(static_cast<std::size_t>(status.st_size) + 1);
  std::size_t length = 0;
  while (true) {
    const ssize_t got = ::read(fd.get(), bytes.data() + length, bytes.size() - length);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return cannot_read(path, errno);
    if (got == 0) break;
    length += static_cast<std::size_t>(got);
    if (length > max_bytes) return too_long(path, max_bytes);
    if (length == bytes.size()) bytes.resize(std::min(2 * bytes.size(), max_bytes + 1));
  }
  bytes.resize(length);
  return Nothing{};
}

}  // namespace loopd
