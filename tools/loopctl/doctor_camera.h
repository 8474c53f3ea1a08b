#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/daemon_config.h"
#include "capture/v4l2_list.h"
#include "loopctl/finding.h"

namespace loopd::loopctl {

/// What is known of who uses the camera now.
struct CameraUse {
  std::string problem;        ///< CameraListing::problem
  std::string users;          ///< as node_users() tells: "process 12 (loopd), process 80 (obs)"
  long daemon_pid = 0;        ///< of the service's daemon; 0: not known
  bool daemon_works = false;  ///< the daemon says that frames come
};

struct JudgedUse {
  Findings findings;
  bool free = false;  ///< so that it can be tried out
};

/// Which of `listings` camera.path means, if any: a node, a link to one, or "serial:NUMBER".
struct FoundCamera {
  Findings findings;  ///< why there is none; or that another path is better
  std::optional<CameraListing> listing;
};
FoundCamera find_v4l2_camera(const CameraConfig& camera, const std::vector<CameraListing>& listings,
                             const V4l2Paths& paths);

/// Whether anything but the daemon itself is in the way.
JudgedUse judge_use(const std::string& node, const CameraUse& use);

/// What of the wished format, size and rate the camera has.
Findings judge_modes(const CameraConfig& camera, const std::vector<V4l2Mode>& modes);

/// Which of libcamera's `listings` camera.path means: a part of its id or name, or the only one.
FoundCamera find_libcamera_camera(const CameraConfig& camera,
                                  const std::vector<CameraListing>& listings);

}  // namespace loopd::loopctl
