#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "events/records.h"

namespace loopd::loopctl {

struct WatchOptions {
  std::string socket_path;
  WatchRequest request;
  bool json = false;                   ///< records as they come, else lines for people
  bool retry = false;                  ///< connect again whenever there is no daemon
  std::optional<std::uint64_t> count;  ///< stop after so many loops
  std::optional<std::chrono::milliseconds> timeout;
};

struct StatusOptions {
  std::string socket_path;
  bool json = false;
  std::chrono::milliseconds timeout{2000};
};

/// Both print to stdout, complaints to stderr, and return the exit status: 0 as asked, 1 not.
int watch(const WatchOptions& options);
int status(const StatusOptions& options);

}  // namespace loopd::loopctl
