#pragma once

#include <cstddef>
#include <string>

#include "app/daemon_config.h"

namespace loopd {

/// What a config costs in memory, bytes: what is bounded, and what each image adds to the map.
struct MemoryPlan {
  std::size_t frame_buffers = 0;
  std::size_t reports = 0;
  std::size_t client_queues = 0;   ///< at most: all clients, all queues full
  std::size_t control_queues = 0;  ///< the same on the control socket
  std::size_t history = 0;         ///< records kept for clients that connect again
  std::size_t recording = 0;       ///< while loopctl record runs
  std::size_t image_features = 0;  ///< kept of one image to verify against
  std::size_t image_words = 0;     ///< at most: every feature a new word

  std::size_t fixed() const {
    return frame_buffers + reports + client_queues + control_queues + history;
  }
  std::size_t per_image() const { return image_features + image_words; }
};

MemoryPlan memory_plan(const DaemonConfig& config);

/// The plan as lines of comment (#) for people.
std::string memory_text(const MemoryPlan& plan);

}  // namespace loopd
