#pragma once

#include <string>
#include <vector>

#include "app/daemon_config.h"

namespace loopd {

/// What a config that was read again changes, as keys ("camera.controls").
struct ConfigChanges {
  DaemonConfig config;               ///< to run with: what can change is taken over
  std::vector<std::string> camera;   ///< taken over by opening the camera again
  std::vector<std::string> at_once;  ///< taken over as they are
  std::vector<std::string> restart;  ///< not taken over: these need a restart

  bool none() const { return camera.empty() && at_once.empty() && restart.empty(); }
};

/// Compares the config in force with the one wanted. A live camera's device, size, rate, format
/// and controls can change, as long as it stays live; the detector's settings would make two maps
/// of one, and memory is allocated once. Reentrant.
ConfigChanges changes_between(const DaemonConfig& in_force, const DaemonConfig& wanted);

/// One sentence for logs and for who asked.
std::string changes_text(const ConfigChanges& changes);

}  // namespace loopd
