#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "base/result.h"
#include "events/records.h"
#include "loopctl/json_view.h"

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

/// What a daemon tells at once: its greeting, and its newest state and counters (null if it has
/// none yet).
struct Snapshot {
  Json hello, state, stats;
};
/// Errors: no daemon, no answer in time, or the daemon says why not.
Result<Snapshot> ask_status(const std::string& socket_path, std::chrono::milliseconds timeout);

/// Both print to stdout, complaints to stderr, and return the exit status: 0 as asked, 1 not.
int watch(const WatchOptions& options);
int status(const StatusOptions& options);

}  // namespace loopd::loopctl
