#pragma once

#include <cstdint>
#include <stop_token>

#include "base/unique_fd.h"

namespace loopd {

/// A request to stop, which can be waited for together with a time, a descriptor or a condition
/// variable. Once made it stays. Thread: thread-safe; request() is not for signal handlers.
class Interrupt {
 public:
  /// Throws std::system_error if there is no descriptor left.
  Interrupt();

  void request();
  bool requested() const { return stop_.stop_requested(); }
  std::stop_token token() const { return stop_.get_token(); }

  /// Readable once requested, for a poll of one's own. Never read from it.
  int fd() const { return event_.get(); }

  /// Waits until CLOCK_MONOTONIC reaches `deadline_ns`; false if interrupted before.
  bool wait_until(std::int64_t deadline_ns) const;

  enum class Ready : std::uint8_t { kReadable, kInterrupted, kTimeout };
  /// Waits until `fd` can be read or has hung up. An interrupt comes first.
  Ready wait_readable(int fd, std::int64_t deadline_ns) const;

 private:
  std::stop_source stop_;
  UniqueFd event_;  ///< eventfd, readable for good once requested
};

}  // namespace loopd
