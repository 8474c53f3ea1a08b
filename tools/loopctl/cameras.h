#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "capture/libcamera_driver.h"
#include "capture/v4l2_list.h"
#include "loopctl/json_view.h"

namespace loopd::loopctl {

/// What could be opened on this machine.
struct CameraList {
  std::vector<CameraListing> v4l2;
  LibcameraBuild build;
  std::vector<CameraListing> libcamera;
  std::string libcamera_problem;  ///< why libcamera could not be asked; empty: it could
};

/// Looks now; takes some 100 ms where there is libcamera.
CameraList find_cameras();

/// The camera.path that is most likely to mean this camera, and no other, after a restart and
/// another order of plugging in: a by-id link or the serial number; where a twin in `all` has the
/// same, a by-path link, which means the port; else the node.
std::string best_path(const CameraListing& listing, const std::vector<CameraListing>& all);

/// The [camera] section that chooses a camera, as lines of TOML.
std::string config_snippet(const std::string& source, const std::string& path);

std::string cameras_text(const CameraList& list);
Json cameras_json(const CameraList& list);

/// Prints what there is. Returns the exit status: 0 if some camera is there, 1 if none is.
int cameras(bool json, std::ostream& out);

}  // namespace loopd::loopctl
