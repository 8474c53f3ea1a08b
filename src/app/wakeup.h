#pragma once

#include <utility>

#include "base/result.h"
#include "base/unique_fd.h"

namespace loopd {

/// An eventfd by which any thread wakes an event loop that waits on fd(). Many wakes before a
/// drain() are one. Thread-safe, except that one thread drains.
class Wakeup {
 public:
  /// Error: the process has no file descriptor left.
  static Result<Wakeup> make();

  int fd() const { return fd_.get(); }
  void wake() const;
  void drain() const;

 private:
  explicit Wakeup(UniqueFd fd) : fd_(std::move(fd)) {}
  UniqueFd fd_;
};

}  // namespace loopd
