#pragma once

#include <poll.h>

#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "app/pipeline.h"
#include "capture/file_camera.h"
#include "support/lap_folder.h"
#include "support/temp_dir.h"

namespace loopd::testing {

/// A loop, by what no run may change.
struct LoopSeen {
  ImageId query = 0;
  ImageId match = 0;
  int inliers = 0;
  auto operator<=>(const LoopSeen&) const = default;
};

inline std::ostream& operator<<(std::ostream& out, const LoopSeen& loop) {
  return out << loop.query << " -> " << loop.match << " (" << loop.inliers << ")";
}

/// Settings under which small images in small folders give loops quickly, as key and value.
inline std::vector<std::pair<std::string, std::string>> small_settings() {
  return {{"features.points", "300"},
          {"features.lines", "60"},
          {"loop.waiting_frames", "8"},
          {"camera.max_pixels", "65536"},
          {"loop.waiting_s", "0"}};
}

inline DaemonConfig small_config(const std::string& path) {
  DaemonConfig config;
  config.camera.path = path;
  config.camera.max_pixels = 65'536;
  config.detector.features.points = 300;
  config.detector.features.lines = 60;
  config.detector.loop.waiting_frames = 8;
  config.detector.loop.waiting_s = 0;
  return config;
}

inline LoopSeen loop_of(const Report& report) {
  return {report.query, report.match.value().image, report.verification.value().inliers()};
}

/// The loops that a Detector alone, in one thread, finds in the frames of `config`'s camera.
inline std::vector<LoopSeen> loops_of_detector_alone(const DaemonConfig& config) {
  FramePool pool(2, static_cast<std::size_t>(config.camera.max_pixels));
  FileCameraOptions options;
  options.path = config.camera.path;
  const auto camera = open_file_camera(options, pool);
  Detector detector(config.detector);
  const auto report = std::make_unique<Report>();
  std::vector<LoopSeen> loops;
  while (true) {
    CameraEvent event = camera.value()->next();
    if (std::holds_alternative<EndOfStream>(event)) return loops;
    if (const Frame* const frame = std::get_if<Frame>(&event)) {
      detector.process(*frame, *report);
      detector.absorb(*report);
      if (report->outcome == Outcome::kLoop) loops.push_back(loop_of(*report));
    }
  }
}

/// Takes what a pipeline gives until it tells `last`; false if nothing came for a minute.
inline bool take_until(Pipeline& pipeline, State last,
                       const std::function<void(const Report&)>& on_report,
                       const std::function<void(const Notice&)>& on_notice) {
  constexpr int kMinute_ms = 60'000;
  bool over = false;
  while (!over) {
    pollfd readable{pipeline.wake_fd(), POLLIN, 0};
    if (poll(&readable, 1, kMinute_ms) != 1) return false;
    pipeline.drain_wakeups();
    std::vector<Notice> notices;
    while (auto notice = pipeline.take_notice()) notices.push_back(*std::move(notice));
    while (const auto taken = pipeline.take_report()) on_report(taken->report);
    for (const Notice& notice : notices) {
      on_notice(notice);
      over = over || (notice.is_state() && notice.record.state == last);
    }
  }
  return true;
}

}  // namespace loopd::testing
