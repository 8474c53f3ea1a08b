#pragma once

#include <memory>

#include "app/daemon_config.h"
#include "base/frame_pool.h"
#include "base/result.h"
#include "capture/camera.h"

namespace loopd {

/// The camera that `camera` asks for, its frames in buffers of `pool`. A live one need not be there
/// (its next() tells), a recording must. Errors: a recording that cannot be opened.
Result<std::unique_ptr<Camera>> open_camera(const CameraConfig& camera, FramePool& pool);

}  // namespace loopd
