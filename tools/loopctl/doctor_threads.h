#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "app/daemon_config.h"
#include "loopctl/finding.h"

namespace loopd::loopctl {

/// "0-3,8" as the kernel and systemd write CPUs, also separated by spaces; what is no number ends
/// it. Reentrant.
std::set<int> parse_cpu_list(std::string_view text);

/// What the threads of the daemon can have.
struct CpuLimits {
  std::set<int> online;
  std::set<int> isolated;               ///< isolcpus=: the kernel moves no thread there by itself
  std::set<int> allowed;                ///< AllowedCPUs= of the unit; empty: all
  std::optional<int> highest_priority;  ///< LimitRTPRIO= of the unit or this user's; none: no limit
  bool by_unit = true;                  ///< so that systemctl edit helps
};

Findings judge_threads(const ThreadsConfig& threads, const CpuLimits& limits);

}  // namespace loopd::loopctl
