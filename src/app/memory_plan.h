#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "app/daemon_config.h"
#include "loopd/capacity.h"

namespace loopd {

/// What a config costs in memory, bytes: buffers of a fixed size, and the map that has the rest of
/// the budget.
struct MemoryPlan {
  std::size_t budget = 0;
  std::size_t frame_buffers = 0;
  std::size_t reports = 0;
  std::size_t client_queues = 0;   ///< at most: all clients, all queues full
  std::size_t control_queues = 0;  ///< the same on the control socket
  std::size_t history = 0;         ///< records kept for clients that connect again
  std::size_t recording = 0;       ///< while loopctl record runs
  MapCapacity map;

  std::size_t fixed() const {
    return frame_buffers + reports + client_queues + control_queues + history + recording;
  }
};

MemoryPlan memory_plan(const DaemonConfig& config);

/// The detector's config, with the part of the budget that is its own.
Config detector_config(const DaemonConfig& config);

/// What is wrong if memory.budget_mib is too small for all that the config asks for. Precondition:
/// nothing else is wrong with it.
std::optional<std::string> budget_violation(const DaemonConfig& config);

/// The plan as lines of comment (#) for people.
std::string memory_text(const MemoryPlan& plan);

}  // namespace loopd
