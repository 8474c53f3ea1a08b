#pragma once

#include <libcamera/camera.h>
#include <libcamera/camera_manager.h>
#include <sys/types.h>

#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "capture/libcamera_formats.h"
#include "capture/libcamera_selection.h"

namespace loopd {

/// A device node of a camera.
struct CameraNode {
  std::string name;  ///< in /dev: "video0"
  dev_t number = 0;
};

/// libcamera, started: its CameraManager and the threads it makes. It stops on destruction, before
/// which every Camera must have been given up. libcamera allows one a process; start() sees to it.
/// Thread: one caller at a time.
class LibcameraManager {
 public:
  /// Enumerates the cameras; libcamera's threads inherit CPUs and priority of the calling one.
  /// Errors: EBUSY if this process has one already, or what libcamera says.
  static Result<std::shared_ptr<LibcameraManager>> start();

  ~LibcameraManager();
  LibcameraManager(const LibcameraManager&) = delete;
  LibcameraManager& operator=(const LibcameraManager&) = delete;

  std::vector<std::shared_ptr<libcamera::Camera>> cameras() const { return manager_->cameras(); }

  /// The capture nodes behind a camera; empty if libcamera does not tell.
  std::vector<CameraNode> nodes(const libcamera::Camera& camera) const;

 private:
  class Lease;
  LibcameraManager(std::unique_ptr<Lease> lease, std::unique_ptr<libcamera::CameraManager> manager);

  std::unique_ptr<Lease> lease_;
  std::unique_ptr<libcamera::CameraManager> manager_;
};

/// Every node of /dev whose name begins with "video", in the order of their numbers.
std::vector<CameraNode> video_nodes();

/// Id and model of a camera.
CameraName camera_name(const libcamera::Camera& camera);

/// libcamera's id, and the serial number where the camera has one behind a USB port.
std::string stable_id(const libcamera::Camera& camera, const std::vector<CameraNode>& nodes);

/// Whether the first of the nodes belongs to a USB device.
bool behind_usb(const std::vector<CameraNode>& nodes);

/// What a stream can be set to.
std::vector<FormatOffer> format_offers(const libcamera::StreamFormats& formats);

}  // namespace loopd
