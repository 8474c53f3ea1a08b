#pragma once

#include <memory>
#include <vector>

#include "base/result.h"
#include "capture/capture_device.h"
#include "capture/libcamera_driver.h"
#include "capture/v4l2_list.h"

namespace loopd {

/// What loopd-libcamera.so, the one part of loopd that links libcamera, offers to the rest.
///
/// Why it is apart: libcamera brings twenty libraries along, of which one starts threads while it
/// is loaded. So it is loaded only for who uses it, and by the thread that does, whose CPUs and
/// priority those threads inherit. It is never unloaded.
struct LibcameraPlugin {
  const char* made_for;  ///< the loopd it was built with, see libcamera_plugin_made_for()
  LibcameraBuild (*build)();
  std::unique_ptr<CaptureDriver> (*make_driver)(const LibcameraOptions& options);
  Result<std::vector<CameraListing>> (*list)();
};

/// Version and compiler: both sides speak C++ and must have been built alike.
constexpr const char* libcamera_plugin_made_for() { return LOOPD_VERSION " " __VERSION__; }

/// Name of the function in loopd-libcamera.so that returns its LibcameraPlugin.
inline constexpr const char* kLibcameraPluginEntry = "loopd_libcamera_plugin";

}  // namespace loopd

extern "C" const loopd::LibcameraPlugin* loopd_libcamera_plugin();
