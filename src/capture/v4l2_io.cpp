#include "capture/v4l2_io.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "base/clock.h"

namespace loopd {

int KernelV4l2Io::open(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return -errno;
  // Opening any other device, a terminal say, can alone have consequences.
  constexpr unsigned kVideo4Linux = 81;
  if (!S_ISCHR(status.st_mode) || major(status.st_rdev) != kVideo4Linux) return -ENOTTY;
  const int fd = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  return fd >= 0 ? fd : -errno;
}

void KernelV4l2Io::close(int fd) { ::close(fd); }

int KernelV4l2Io::ioctl(int fd, unsigned long request, void* argument) {
  const int result = ::ioctl(fd, request, argument);
  return result >= 0 ? result : -errno;
}

void* KernelV4l2Io::map(int fd, std::size_t length, std::int64_t offset, int& error) {
  void* memory = ::mmap(nullptr, length, PROT_READ, MAP_SHARED, fd, offset);
  if (memory != MAP_FAILED) return memory;
  error = -errno;
  return nullptr;
}

void KernelV4l2Io::unmap(void* memory, std::size_t length) { ::munmap(memory, length); }

int KernelV4l2Io::poll(std::span<pollfd> fds, std::int64_t deadline_ns) {
  const std::int64_t left_ns = std::max<std::int64_t>(deadline_ns - now_ns(), 0);
  const timespec timeout{left_ns / 1'000'000'000, left_ns % 1'000'000'000};
  const int ready = ::ppoll(fds.data(), fds.size(), &timeout, nullptr);
  return ready >= 0 ? ready : -errno;
}

std::int64_t KernelV4l2Io::now_ns() { return monotonic_now_ns(); }

V4l2Node V4l2Node::open(V4l2Io& io, const std::string& path, int& error) {
  int fd = 0;
  do fd = io.open(path);
  while (fd == -EINTR);
  if (fd < 0) error = fd;
  return fd < 0 ? V4l2Node() : V4l2Node(io, fd);
}

void V4l2Node::reset() {
  if (fd_ >= 0) io_->close(fd_);
  fd_ = -1;
}

int V4l2Node::call_raw(unsigned long request, void* argument) const {
  int result = 0;
  do result = io_->ioctl(fd_, request, argument);
  while (result == -EINTR);
  return result;
}

}  // namespace loopd
