#pragma once

#include <chrono>

#include "base/unique_fd.h"

namespace loopd::loopctl {

/// SIGINT and SIGTERM as a descriptor, so that waiting for them and for something else is one wait.
/// From its making on they no longer end the process. Thread: made and used by the main thread.
class StopSignals {
 public:
  StopSignals();

  int fd() const { return fd_.get(); }  ///< readable if one has come

  /// Whether one has come, waiting for it at most `wait`; that one is then done with.
  bool take(std::chrono::milliseconds wait = std::chrono::milliseconds(0)) const;

 private:
  UniqueFd fd_;
};

}  // namespace loopd::loopctl
