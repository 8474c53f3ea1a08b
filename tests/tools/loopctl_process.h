#pragma once

#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "support/child_process.h"
#include "support/temp_dir.h"

namespace loopd::testing {

/// loopctl with `arguments`, its output in files of `folder`.
class LoopctlProcess : public ChildProcess {
 public:
  LoopctlProcess(const TempDir& folder, std::vector<std::string> arguments,
                 const std::vector<std::string>& environment = {})
      : ChildProcess(command(std::move(arguments)), (folder / "loopctl").string(), environment) {}

  bool ended() { return wait(std::chrono::milliseconds(0)).has_value(); }

 private:
  static std::vector<std::string> command(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), LOOPCTL_PATH);
    return arguments;
  }
};

/// The exit code of loopctl with `arguments`, run to its end.
struct LoopctlResult {
  int exit_code = -1;
  std::string out;
  std::string err;
};

inline LoopctlResult run_loopctl(const TempDir& folder, std::vector<std::string> arguments,
                                 const std::vector<std::string>& environment = {}) {
  LoopctlProcess process(folder, std::move(arguments), environment);
  const int exit_code = process.wait().value_or(-1);
  return {exit_code, process.standard_output(), process.standard_error()};
}

}  // namespace loopd::testing
