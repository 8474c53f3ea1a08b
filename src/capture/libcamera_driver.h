#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"
#include "capture/capture_device.h"
#include "capture/v4l2_list.h"

namespace loopd {

/// Which of libcamera's cameras is wanted, and how it is to be set.
struct LibcameraOptions {
  /// libcamera's own id of the camera, or a part of its id or of its model name that no other
  /// camera has; empty: the only one, or the first of several.
  std::string camera{};
  int width_px = 0;  ///< both 0: what libcamera proposes; else the nearest size the camera has
  int height_px = 0;
  double fps = 0;  ///< 0: the pipeline's default; else by FrameDurationLimits where it has that
  /// "auto": the one that costs least to turn into luma; else a code of pixel_format_name().
  std::string format = "auto";
  /// Controls by libcamera's names and their values as text: {"AeEnable", "false"},
  /// {"ExposureTime", "8000"}, {"ColourGains", "1.5,2"}. What the camera does not know, and what is
  /// no value of it, is not set and named by DeviceInfo::warnings.
  std::vector<std::pair<std::string, std::string>> controls{};
  int buffers = 0;  ///< 0: what the pipeline proposes, at least 4; else 2 to 32
};

/// Whether loopd-libcamera.so is there, and its libcamera: "libcamera v0.0.3", or why not. Loads
/// it.
struct LibcameraBuild {
  bool present = false;
  std::string text;
};
LibcameraBuild libcamera_build();

/// A driver for cameras that libcamera drives (sensors with an image processor, and USB cameras).
///
/// open() starts a new CameraManager each time, so that it sees what is there now even where udev's
/// messages do not arrive (PrivateNetwork=yes), and on the calling thread, so that libcamera's own
/// threads inherit its CPUs and priority. The manager lives as long as the device opened. A process
/// can have one manager only: a second driver's open() says kBusy. Once a camera was opened,
/// open() takes the same again: another one only if that appeared since and is what `camera` names.
///
/// libcamera's own log is off unless LIBCAMERA_LOG_LEVELS or LIBCAMERA_LOG_FILE is set.
/// libcamera itself is loaded by the first open(), in its thread (libcamera_plugin.h); where it is
/// not installed every open() is the error "this loopd has no libcamera; ...".
std::unique_ptr<CaptureDriver> make_libcamera_driver(const LibcameraOptions& options);

/// The cameras libcamera sees now, told as V4L2's are: `node` is libcamera's id (for camera.path),
/// `name` the model, `driver` "libcamera", `bus` the nodes in /dev behind it, as far as known.
/// Modes that can be read have the code of their PixelFormat, the others DRM's; rates are not
/// known. Blocks as long as it takes to look (some 100 ms). Errors: this build has no libcamera, it
/// does not start, or a driver of this process has a camera open.
Result<std::vector<CameraListing>> list_libcamera_cameras();

}  // namespace loopd
