#pragma once

#include <string>
#include <vector>

#include "capture/capture_device.h"
#include "capture/v4l2_formats.h"
#include "capture/v4l2_io.h"

namespace loopd {

/// A video node that frames could be captured from, or that could not be asked.
struct CameraListing {
  std::string node;                ///< "/dev/video0"
  std::vector<std::string> links;  ///< below /dev/v4l: names that outlive another order of plugging
  std::string id;                  ///< as DeviceInfo::id; empty if it could not be asked
  std::string name;                ///< as DeviceInfo::name
  std::string serial;              ///< for camera.path = "serial:..."; empty if it has none
  std::string driver;              ///< "uvcvideo"
  std::string bus;                 ///< "usb-0000:00:14.0-1"
  std::vector<V4l2Mode> modes;     ///< formats, sizes, rates; those with no `format` cannot be read
  std::string problem;             ///< why it cannot be opened now, with the remedy; empty: it can
};

/// All capture nodes, in the order of their numbers. Opens each for a moment and asks, which starts
/// no stream, changes no setting and takes nothing from who streams from it. Metadata and output
/// nodes are left out. Reentrant.
std::vector<CameraListing> list_v4l2_cameras();
std::vector<CameraListing> list_v4l2_cameras(V4l2Io& io, const V4l2Paths& paths);

/// The lines of one format: "YUYV  640x480 (30, 15 fps), 1280x720 (10 fps)", for people.
std::string mode_text(const V4l2Mode& mode);

}  // namespace loopd
