#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "capture/capture_device.h"
#include "capture/v4l2_io.h"

namespace loopd {

/// Which V4L2 camera is wanted, and how it is to be set.
struct V4l2Options {
  /// A node or a link to one ("/dev/video0", "/dev/v4l/by-id/..."), or "serial:" and the serial
  /// number of a USB camera. Links and serial numbers outlive another order of plugging in.
  std::string camera{};
  int width_px = 0;  ///< the nearest size the camera has; both 0: the driver's current one
  int height_px = 0;
  double fps = 0;  ///< 0: the driver's default
  /// "auto": the format that costs least to turn into luma, among those that reach size and rate;
  /// else a code of pixel_format_name().
  std::string format = "auto";
  /// Controls by V4L2's names as v4l2-ctl writes them, and their values as text, set in this order:
  /// {"auto_exposure", "1"}, {"exposure_time_absolute", "200"}. What the camera does not know or
  /// refuses is named by DeviceInfo::warnings and costs nothing else.
  std::vector<std::pair<std::string, std::string>> controls{};
  int buffers = 4;  ///< memory-mapped buffers to ask the driver for, 2 to 32
};

/// A driver for cameras behind the kernel's V4L2: USB cameras, frame grabbers, and sensors whose
/// driver gives finished pixels. Every open() looks the camera up anew.
/// hotplug_fd() watches /dev and the folder of the link itself, with no need of udev.
std::unique_ptr<CaptureDriver> make_v4l2_driver(const V4l2Options& options);

/// The same over another kernel, for tests; `io` must outlive the driver and its devices.
std::unique_ptr<CaptureDriver> make_v4l2_driver(const V4l2Options& options, V4l2Io& io,
                                                const V4l2Paths& paths);

}  // namespace loopd
