#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "app/daemon_config.h"
#include "base/result.h"
#include "capture/camera.h"
#include "loopctl/finding.h"

namespace loopd::loopctl {

/// How the brightness of an image is spread.
struct LumaLook {
  double mean = 0;       ///< 0 black .. 255 white
  double deviation = 0;  ///< standard deviation
};

/// Of every 8th pixel in every 8th row. Precondition: the view has pixels.
LumaLook look_at(const LumaView& view);

/// What a few frames of a camera were like.
struct Trial {
  std::uint64_t frames = 0;
  double rate_hz = 0;  ///< of what arrived; 0: too few to tell
  std::uint64_t corrupt = 0;
  std::uint64_t restamped = 0;
  std::vector<std::string> settings;     ///< CameraNotice::kSettings: what could not be had
  std::vector<std::string> time_stamps;  ///< CameraNotice::kTimeStamps
  std::string opened;                    ///< which camera, and how it is set
  std::optional<CameraError> lost;       ///< the newest reason why no frame came
  std::optional<LumaLook> look;          ///< of the last frame
  int width_px = 0;                      ///< of the last frame
  int height_px = 0;
};

/// Takes frames until there are `frames` of them, the recording is over, or time is up (and the
/// camera's next() has returned).
Trial try_out(Camera& camera, std::uint64_t frames, std::chrono::milliseconds time);

/// Opens the camera of `config` as the daemon does, which sets it as the config says, and takes
/// some frames. Errors: a recording that cannot be opened; no memory for the frames.
Result<Trial> try_camera(const CameraConfig& config);

Findings judge_trial(const Trial& trial, const CameraConfig& config);

}  // namespace loopd::loopctl
