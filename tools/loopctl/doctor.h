#pragma once

#include <optional>
#include <ostream>
#include <string>

#include "loopctl/finding.h"

namespace loopd::loopctl {

struct DoctorOptions {
  std::string name = "front";         ///< of the camera
  std::optional<std::string> config;  ///< none: /etc/loopd/NAME.toml
  bool json = false;
  bool no_trial = false;  ///< take no frames
};

/// Looks at everything that lets the daemon of one camera work: settings, device, permissions,
/// unit, sockets, and the daemon itself. Takes some seconds.
Findings examine(const DoctorOptions& options);

/// Prints what it found. Returns the exit status: 0 no problem, 1 some.
int doctor(const DoctorOptions& options, std::ostream& out);

}  // namespace loopd::loopctl
