#pragma once

#include <string>

#include "capture/camera.h"

namespace loopd {

/// An error with which the device is of no more use.
CameraError lost_camera(CameraFault fault, std::string message, int code);

/// What a negative status of libcamera (or an errno) means for the camera `id`: the fault, and a
/// sentence of `what` went wrong, why, and the remedy.
CameraError libcamera_failure(const std::string& id, const std::string& what, int status);

}  // namespace loopd
