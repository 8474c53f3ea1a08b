#pragma once

#include <string>

#include "capture/camera.h"
#include "capture/v4l2_io.h"

namespace loopd {

/// What became of a system call on the video node `node`: `tried` ("set the format of"), `result`
/// is its negative errno. Names the fault, the likely remedy, and for a busy or forbidden node who
/// has it. All are `lost`: there is no stream without another open(). Reentrant; reads /proc when
/// busy.
CameraError v4l2_error(const V4l2Paths& paths, const std::string& node, const std::string& tried,
                       int result);

/// A sentence about `node` that no errno stands behind.
CameraError v4l2_fault(CameraFault fault, const std::string& node, const std::string& what);

}  // namespace loopd
