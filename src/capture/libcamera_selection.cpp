#include "capture/libcamera_selection.h"

#include <cerrno>
#include <vector>

#include "capture/libcamera_error.h"

namespace loopd {
namespace {

CameraError no_device(std::string message) {
  return lost_camera(CameraFault::kNoDevice, std::move(message), ENODEV);
}

std::string listed(std::span<const CameraName> cameras) {
  std::string text;
  for (const CameraName& camera : cameras) {
    if (!text.empty()) text += ", ";
    text += camera.id;
    if (!camera.model.empty()) text += " (" + camera.model + ")";
  }
  return text;
}

}  // namespace

CameraSelection::Choice CameraSelection::choose(std::span<const CameraName> cameras) const {
  std::vector<std::size_t> fitting;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i].id == wanted_ || (kept_ && cameras[i].id == *kept_)) return i;
    if (fits(cameras[i]) && !stood_beside(cameras[i])) fitting.push_back(i);
  }
  if (fitting.empty()) return none(cameras);
  if (fitting.size() == 1 || wanted_.empty()) return fitting.front();
  return no_device("cannot choose a libcamera camera: \"" + wanted_ + "\" fits several of " +
                   listed(cameras) + "; give the whole id of one");
}

void CameraSelection::keep(std::span<const CameraName> cameras, std::size_t index) {
  kept_ = cameras[index].id;
  bystanders_.clear();
  for (const CameraName& camera : cameras)
    if (camera.id != *kept_) bystanders_.insert(camera.id);
}

bool CameraSelection::fits(const CameraName& camera) const {
  return camera.id.find(wanted_) != std::string::npos ||
         camera.model.find(wanted_) != std::string::npos;
}

bool CameraSelection::stood_beside(const CameraName& camera) const {
  return bystanders_.contains(camera.id);
}

CameraError CameraSelection::none(std::span<const CameraName> cameras) const {
  if (cameras.empty())
    return no_device(
        "libcamera sees no camera; plug it in, and see that the driver of the kernel is loaded");
  const std::string& name = kept_ ? *kept_ : wanted_;
  return no_device("libcamera does not see the camera " + name + ", only " + listed(cameras) +
                   "; plug it in, or correct the camera's name");
}

}  // namespace loopd
