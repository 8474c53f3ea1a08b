#pragma once

#include <optional>
#include <string>

#include "loopctl/doctor_access.h"
#include "loopctl/finding.h"
#include "loopctl/session.h"

namespace loopd::loopctl {

/// A socket of the daemon, as it lies there.
struct SocketFile {
  std::string path;
  bool control = false;           ///< for owner and group only; else for all
  bool expected = false;          ///< the daemon runs, or systemd listens
  std::optional<Ownership> file;  ///< none: it is not there
};

Findings judge_socket_file(const SocketFile& socket);

/// What the daemon tells of itself. `version`: of this loopctl.
Findings judge_daemon(const Snapshot& snapshot, const std::string& version);

}  // namespace loopd::loopctl
