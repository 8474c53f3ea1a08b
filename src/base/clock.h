#pragma once

#include <time.h>

#include <cstdint>

namespace loopd {

/// CLOCK_MONOTONIC now, nanoseconds: the clock of every time in loopd. Thread-safe.
inline std::int64_t monotonic_now_ns() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

}  // namespace loopd
