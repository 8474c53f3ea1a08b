#pragma once

#include <poll.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>

namespace loopd {

/// The system calls of the V4L2 driver, so that a test can stand in for the kernel.
///
/// Each acts as the call of its name, and answers a failure as the negative errno, EINTR included.
/// Thread: as the real calls.
class V4l2Io {
 public:
  virtual ~V4l2Io() = default;

  /// Opens a video node non-blocking and close-on-exec for reading and writing. Returns the
  /// descriptor or -errno; -ENOTTY for what is no video node, without opening it.
  virtual int open(const std::string& path) = 0;
  virtual void close(int fd) = 0;
  virtual int ioctl(int fd, unsigned long request, void* argument) = 0;
  /// A shared mapping to read from; null on failure, then `error` is the negative errno.
  virtual void* map(int fd, std::size_t length, std::int64_t offset, int& error) = 0;
  virtual void unmap(void* memory, std::size_t length) = 0;
  /// Waits until CLOCK_MONOTONIC reaches `deadline_ns`. Returns how many are ready, or -errno.
  virtual int poll(std::span<pollfd> fds, std::int64_t deadline_ns) = 0;
  virtual std::int64_t now_ns() = 0;
};

/// The kernel's own. Stateless.
class KernelV4l2Io final : public V4l2Io {
 public:
  int open(const std::string& path) override;
  void close(int fd) override;
  int ioctl(int fd, unsigned long request, void* argument) override;
  void* map(int fd, std::size_t length, std::int64_t offset, int& error) override;
  void unmap(void* memory, std::size_t length) override;
  int poll(std::span<pollfd> fds, std::int64_t deadline_ns) override;
  std::int64_t now_ns() override;
};

/// An open video node, or another descriptor of one; closed on destruction. Move-only.
/// Thread: one owner.
class V4l2Node {
 public:
  V4l2Node() = default;
  V4l2Node(V4l2Io& io, int fd) : io_(&io), fd_(fd) {}
  ~V4l2Node() { reset(); }
  V4l2Node(V4l2Node&& other) noexcept : io_(other.io_), fd_(std::exchange(other.fd_, -1)) {}
  V4l2Node& operator=(V4l2Node&& other) noexcept {
    if (this == &other) return *this;
    reset();
    io_ = other.io_;
    fd_ = std::exchange(other.fd_, -1);
    return *this;
  }

  /// Opens `path`; without effect on a failure, then `error` is the negative errno.
  static V4l2Node open(V4l2Io& io, const std::string& path, int& error);

  bool valid() const { return fd_ >= 0; }
  int fd() const { return fd_; }
  V4l2Io& io() const { return *io_; }
  void reset();

  /// ioctl, repeated where a signal came between. Returns its result or -errno.
  template <class Argument>
  int call(unsigned long request, Argument& argument) const {
    return call_raw(request, &argument);
  }

 private:
  int call_raw(unsigned long request, void* argument) const;

  V4l2Io* io_ = nullptr;
  int fd_ = -1;
};

/// Where the kernel shows what it knows of devices; other folders only in tests.
struct V4l2Paths {
  std::string dev = "/dev";
  std::string sys = "/sys";
  std::string proc = "/proc";
};

}  // namespace loopd
