#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/unique_fd.h"

namespace loopd {

/// A child process whose output is read through pipes; killed and reaped on destruction.
///
/// It starts with nothing of ours but the environment and the CPU set: standard input is empty, no
/// other descriptor is open, signals are at their defaults and it runs at normal priority.
/// Thread: one caller at a time.
class ChildProcess {
 public:
  /// Starts `arguments[0]`: a path, or a name to look for in PATH, with the other arguments.
  /// Errors: it is not there, is no program, or no process or descriptor can be had.
  static Result<ChildProcess> start(const std::vector<std::string>& arguments);

  ~ChildProcess();
  ChildProcess(ChildProcess&& other) noexcept;
  ChildProcess& operator=(ChildProcess&& other) noexcept;

  /// Non-blocking; ends when the process has closed its standard output.
  int output() const { return output_.get(); }

  /// What the process has said on standard error so far, at most `max_bytes` of it.
  std::string error_text(std::size_t max_bytes);

  /// Kills the process if it still runs, reaps it, and returns what a wait says of it
  /// (WIFEXITED and so on). A process that has ended by itself keeps its own status.
  int finish();

  /// Readable once the process has ended; -1 if the kernel offers no such descriptor.
  int exit_fd() const { return process_.get(); }

 private:
  ChildProcess(pid_t pid, UniqueFd process, UniqueFd output, UniqueFd errors)
      : pid_(pid),
        process_(std::move(process)),
        output_(std::move(output)),
        errors_(std::move(errors)) {}

  pid_t pid_ = -1;  ///< -1 once reaped
  int status_ = 0;
  UniqueFd process_;  ///< pidfd
  UniqueFd output_;
  UniqueFd errors_;
};

}  // namespace loopd
