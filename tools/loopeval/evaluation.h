#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/daemon_config.h"
#include "base/frame_pool.h"
#include "base/lanes.h"
#include "base/result.h"
#include "capture/camera.h"
#include "loopd/detector.h"
#include "loopeval/frames_csv.h"
#include "loopeval/gallery.h"
#include "loopeval/progress.h"
#include "loopeval/summary.h"

namespace loopd::loopeval {

/// One run of the detector over a recording: the camera, the lanes and the calls of the detector
/// are the daemon's in lock-step, so that what is written is what the daemon would tell.
/// Thread: one owner.
class Evaluation {
 public:
  /// Opens config.camera.path. Precondition: validate(config) is empty, config.camera.fps is 0.
  /// Errors: the recording cannot be opened; the lines thread cannot start.
  static Result<std::unique_ptr<Evaluation>> open(const DaemonConfig& config);

  /// Frames to come, as far as that is known before (a folder; not a video).
  std::optional<std::size_t> length() const;

  /// Runs to the end, a row of `csv` for every frame. Once only. Errors: a row cannot be written;
  /// the recording breaks off.
  Status run(FramesCsv& csv, Gallery& gallery, Progress& progress);

  const Summary& summary() const { return summary_; }

 private:
  struct Parts;
  Evaluation(const DaemonConfig& config, Parts parts);
  Status take(const Frame& frame, FramesCsv& csv, Gallery& gallery);
  Status take(const CameraError& error, FramesCsv& csv, Progress& progress);
  std::string file_name(std::uint64_t sequence) const;

  const std::size_t start_;
  const std::vector<std::string> images_;  ///< empty: a video
  const std::string path_;
  // In this order: what is declared later uses what is declared before.
  std::unique_ptr<FramePool> pool_;
  std::unique_ptr<Camera> camera_;
  std::unique_ptr<TwoLanes> lanes_;  ///< null: one lane
  Detector detector_;
  Report report_;
  std::vector<std::uint64_t> sequences_;  ///< Frame::sequence by ImageId
  std::optional<CameraError> away_;       ///< the camera is lost and has not come back
  Summary summary_;
};

/// The recording of `config` as the daemon opens it in lock-step.
Result<std::unique_ptr<Camera>> open_recording(const DaemonConfig& config, FramePool& pool);

}  // namespace loopd::loopeval
