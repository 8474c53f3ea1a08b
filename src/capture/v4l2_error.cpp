#include "capture/v4l2_error.h"

#include <cerrno>
#include <system_error>

#include "capture/v4l2_sysfs.h"

namespace loopd {
namespace {

std::string permission_remedy(const std::string& node, int code) {
  if (code == EPERM)
    return "allow it to the service (DeviceAllow=char-video4linux rw, and the videodev module "
           "loaded before the service starts)";
  const std::string group = owning_group(node);
  if (group.empty()) return "give its user access to the node";
  return "the node belongs to the group " + group +
         "; add the user to it (SupplementaryGroups= in the unit)";
}

std::string busy_remedy(const V4l2Paths& paths, const std::string& node) {
  const std::string users = node_users(paths, node);
  return users.empty() ? "another program streams from it; end that one (fuser -v " + node + ")"
                       : "it is in use by " + users + "; end that program";
}

}  // namespace

CameraError v4l2_error(const V4l2Paths& paths, const std::string& node, const std::string& tried,
                       int result) {
  CameraError error{CameraFault::kStreamError, "", -result, true, 0};
  std::string remedy;
  switch (-result) {
    case ENOENT:
    case ENXIO:
    case ENODEV:
      error.fault = CameraFault::kNoDevice;
      remedy = "plug the camera in, or correct camera.path";
      break;
    case EACCES:
    case EPERM:
      error.fault = CameraFault::kPermission;
      remedy = permission_remedy(node, -result);
      break;
    case EBUSY:
      error.fault = CameraFault::kBusy;
      remedy = busy_remedy(paths, node);
      break;
    case ENOTTY:
      error.fault = CameraFault::kUnsupported;
      remedy = "it does not do what a V4L2 camera must; camera.path must name a capture node";
      break;
    case ENOMEM:
    case EMFILE:
    case ENFILE:
      remedy = "the machine is short of memory or descriptors";
      break;
    case ENOSPC:
      remedy =
          "the USB bus has no bandwidth left for it; choose a smaller size or rate, MJPG, or "
          "another port";
      break;
    default:
      remedy = "it is tried again; if that does not help, plug it in again and see the kernel log";
  }
  error.message = "cannot " + tried + " " + node + ": " + std::generic_category().message(-result) +
                  "; " + remedy;
  return error;
}

CameraError v4l2_fault(CameraFault fault, const std::string& node, const std::string& what) {
  return {fault, node + " " + what, 0, true, 0};
}

}  // namespace loopd
