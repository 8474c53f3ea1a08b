#pragma once

#include <optional>
#include <string>

#include "app/daemon_config.h"
#include "loopctl/doctor_access.h"
#include "loopctl/finding.h"

namespace loopd::loopctl {

struct CheckedConfig {
  Findings findings;
  std::optional<DaemonConfig> config;  ///< none if there are mistakes
};

/// Reads the config file as the service of `camera` does, and validates it: every mistake is a
/// problem.
CheckedConfig check_config(const std::string& path, const std::string& camera);

/// Whether the kernel has what `source` needs; `proc_devices` is the text of /proc/devices.
Findings judge_device_classes(const std::string& proc_devices, const std::string& source);

/// Whether the map has room; `memory_max` (bytes) is the unit's MemoryMax=, none if unlimited or
/// not known, `machine_bytes` what the machine has.
Finding judge_memory(const DaemonConfig& config, std::optional<std::uint64_t> memory_max,
                     std::uint64_t machine_bytes);

}  // namespace loopd::loopctl
