#pragma once

#include <chrono>
#include <optional>
#include <ostream>
#include <string>

#include "base/result.h"
#include "events/control_client.h"

namespace loopd::loopctl {

/// What loopctl pause, resume, reset and reload are told.
struct ControlCommand {
  ControlOp op = ControlOp::kPause;
  std::string control_path;
  bool json = false;                          ///< the daemon's answer as it is
  std::chrono::milliseconds timeout{10'000};  ///< of the answer
};

/// ControlClient::connect, with what to do for those who may not: join the socket's group.
Result<ControlClient> connect_control(const std::string& control_path);

/// What lets `user` use a socket of the group `group` (none: not known): one clause.
std::string permission_remedy(const std::string& user, const std::optional<std::string>& group);

/// What the daemon's `ok` to `op` means, for people.
std::string done_text(ControlOp op, const std::string& answer);

/// Asks, and prints the answer to `out` or the complaint to `err`. Returns the exit status: 0 done,
/// 1 not.
int control(const ControlCommand& command, std::ostream& out, std::ostream& err);

}  // namespace loopd::loopctl
