#include "app/memory_plan.h"

#include "app/report_queue.h"
#include "capture/recording_writer.h"
#include "events/control_server.h"

namespace loopd {
namespace {

constexpr std::size_t kMib = std::size_t{1} << 20;

std::string mib_text(std::size_t bytes) {
  const std::size_t tenths = (bytes * 10 + (1 << 19)) >> 20;
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " MiB";
}

// All but the map.
MemoryPlan buffers_of(const DaemonConfig& config) {
  MemoryPlan plan;
  plan.budget = static_cast<std::size_t>(config.memory.budget_mib) * kMib;
  plan.frame_buffers = static_cast<std::size_t>(config.camera.buffers) *
                       static_cast<std::size_t>(config.camera.max_pixels);
  plan.reports = ReportQueue::bytes(static_cast<std::size_t>(config.events.report_queue));
  const ControlOptions control;
  plan.client_queues = static_cast<std::size_t>(config.events.max_clients) *
                       static_cast<std::size_t>(config.events.client_queue_kib) * 1024;
  plan.control_queues = static_cast<std::size_t>(control.max_clients) * control.client_queue_bytes;
  plan.history = static_cast<std::size_t>(config.events.history_kib) * 1024;
  plan.recording = RecordingOptions().buffer_bytes;
  return plan;
}

}  // namespace

MemoryPlan memory_plan(const DaemonConfig& config) {
  MemoryPlan plan = buffers_of(config);
  plan.map = map_capacity(detector_config(config));
  return plan;
}

Config detector_config(const DaemonConfig& config) {
  const MemoryPlan plan = buffers_of(config);
  Config detector = config.detector;
  detector.memory_budget_bytes =
      static_cast<std::int64_t>(plan.budget) - static_cast<std::int64_t>(plan.fixed());
  return detector;
}

std::optional<std::string> budget_violation(const DaemonConfig& config) {
  const MemoryPlan plan = memory_plan(config);
  if (plan.map.full_images >= MapCapacity::kLeastImages) return std::nullopt;
  const std::size_t map = least_map_bytes(config.detector);
  const std::size_t least_mib = (plan.fixed() + map + kMib - 1) / kMib;
  return "memory.budget_mib = " + std::to_string(config.memory.budget_mib) +
         ". Violated constraint: memory.budget_mib >= " + std::to_string(least_mib) + ": " +
         mib_text(plan.fixed()) + " of buffers and a map of " +
         std::to_string(MapCapacity::kLeastImages) + " images, " + mib_text(map) +
         " (smaller with less of camera.max_pixels, camera.buffers, events.max_clients or "
         "features.points)";
}

std::string memory_text(const MemoryPlan& plan) {
  return "# memory, all:            " + mib_text(plan.budget) + "\n#   frame buffers         " +
         mib_text(plan.frame_buffers) + "\n#   reports               " + mib_text(plan.reports) +
         "\n#   client queues, full   " + mib_text(plan.client_queues + plan.control_queues) +
         "\n#   history               " + mib_text(plan.history) + "\n#   recording             " +
         mib_text(plan.recording) + "\n#   map                   " + mib_text(plan.map.bytes) +
         "\n# the map holds:          " + std::to_string(plan.map.full_images) +
         " images of as many features as a frame may have,\n#                         more of "
         "poorer ones, at most " +
         std::to_string(plan.map.images) + "\n#                         " +
         std::to_string(plan.map.words_points) + " words of points, " +
         std::to_string(plan.map.words_lines) + " of lines\n";
}

}  // namespace loopd
