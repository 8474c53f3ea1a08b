#include "app/memory_plan.h"

#include "app/report_queue.h"
#include "capture/recording_writer.h"
#include "events/control_server.h"
#include "loopd/features.h"

namespace loopd {
namespace {

/// Of one word: its descriptor, its record with two postings, and its places in the look-up tables
/// (128 bytes at the fill they are kept at).
constexpr std::size_t kBytesPerWord = sizeof(Descriptor) + 32 + 128;

std::string mib_text(std::size_t bytes) {
  const std::size_t tenths = (bytes * 10 + (1 << 19)) >> 20;
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " MiB";
}

}  // namespace

MemoryPlan memory_plan(const DaemonConfig& config) {
  const auto points = static_cast<std::size_t>(config.detector.features.points);
  const auto lines = static_cast<std::size_t>(config.detector.features.lines);
  MemoryPlan plan;
  plan.frame_buffers = static_cast<std::size_t>(config.camera.buffers) *
                       static_cast<std::size_t>(config.camera.max_pixels);
  plan.reports = ReportQueue::bytes(static_cast<std::size_t>(config.events.report_queue));
  const ControlOptions control;
  plan.client_queues = static_cast<std::size_t>(config.events.max_clients) *
                       static_cast<std::size_t>(config.events.client_queue_kib) * 1024;
  plan.control_queues = static_cast<std::size_t>(control.max_clients) * control.client_queue_bytes;
  plan.history = static_cast<std::size_t>(config.events.history_kib) * 1024;
  plan.recording = RecordingOptions().buffer_bytes;
  plan.image_features =
      points * (sizeof(Point) + sizeof(Descriptor)) + lines * (sizeof(Line) + sizeof(Descriptor));
  plan.image_words = (points + lines) * kBytesPerWord;
  return plan;
}

std::string memory_text(const MemoryPlan& plan) {
  constexpr std::size_t kImages = 1000;
  return "# memory, fixed:          " + mib_text(plan.fixed()) + "\n#   frame buffers         " +
         mib_text(plan.frame_buffers) + "\n#   reports               " + mib_text(plan.reports) +
         "\n#   client queues, full   " + mib_text(plan.client_queues + plan.control_queues) +
         "\n#   history               " + mib_text(plan.history) +
         "\n# memory, recording:      " + mib_text(plan.recording) +
         "\n# memory, 1000 images:    " + mib_text(kImages * plan.per_image()) + " at most" +
         "\n#   features              " + mib_text(kImages * plan.image_features) +
         "\n#   words, all new        " + mib_text(kImages * plan.image_words) + "\n";
}

}  // namespace loopd
