#include "events/passed_fds.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace loopd {

namespace {

/// Two, so that a second one is seen; the kernel closes those that find no room.
constexpr std::size_t kRoom = 2;

}  // namespace

ssize_t PassedFds::receive(int socket, std::span<char> into, bool& cut_off) {
  alignas(cmsghdr) std::array<char, CMSG_SPACE(kRoom * sizeof(int))> control{};
  iovec part{into.data(), into.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t n = recvmsg(socket, &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
  if (n < 0) return n;
  cut_off = (message.msg_flags & MSG_TRUNC) != 0;
  keep(message);
  return n;
}

void PassedFds::keep(const msghdr& message) {
  // The macros write, on paper, through the header they are given.
  auto& header = const_cast<msghdr&>(message);
  for (cmsghdr* c = CMSG_FIRSTHDR(&header); c != nullptr; c = CMSG_NXTHDR(&header, c)) {
    if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_RIGHTS) continue;
    const std::size_t bytes = c->cmsg_len - CMSG_LEN(0);
    for (std::size_t at = 0; at + sizeof(int) <= bytes; at += sizeof(int)) {
      int fd = -1;
      std::memcpy(&fd, CMSG_DATA(c) + at, sizeof(fd));
      UniqueFd passed(fd);
      if (count_++ == 0) first_ = std::move(passed);
    }
  }
  if ((message.msg_flags & MSG_CTRUNC) != 0) ++count_;  // one that found no room, or was no fd left
}

Result<UniqueFd> PassedFds::take() {
  const std::size_t count = count_;
  UniqueFd fd = std::move(first_);
  clear();
  if (count == 1 && fd.valid()) return fd;
  if (count == 0) {
    return Error{"a file descriptor to write to must be passed along (SCM_RIGHTS)", EBADF};
  }
  return Error{"exactly one file descriptor can be passed along; more came, or one was lost",
               EINVAL};
}

void PassedFds::clear() {
  first_.reset();
  count_ = 0;
}

Status check_recording_file(const UniqueFd& fd) {
  struct stat file;
  const int flags = fcntl(fd.get(), F_GETFL);
  if (flags < 0 || fstat(fd.get(), &file) != 0) {
    return errno_error("cannot tell what the passed file descriptor is", errno);
  }
  if (!S_ISREG(file.st_mode)) {
    return Error{"the passed file descriptor is no regular file", EINVAL};
  }
  const int access = flags & O_ACCMODE;
  if ((access != O_WRONLY && access != O_RDWR) || (flags & O_PATH) != 0) {
    return Error{"the passed file is not open for writing", EINVAL};
  }
  if ((flags & O_APPEND) != 0) return Error{"the passed file is open for appending", EINVAL};
  return Nothing();
}

}  // namespace loopd
