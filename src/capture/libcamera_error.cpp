#include "capture/libcamera_error.h"

#include <cerrno>
#include <cstdlib>
#include <system_error>

namespace loopd {
namespace {

struct Cause {
  CameraFault fault;
  const char* remedy;
};

Cause cause_of(int code) {
  switch (code) {
    case EBUSY:
      return {CameraFault::kBusy, "end the other program that uses it"};
    case EACCES:
    case EPERM:
      return {CameraFault::kPermission, "let this user read and write the camera's nodes in /dev"};
    case ENODEV:
    case ENXIO:
      return {CameraFault::kNoDevice, "plug it in again"};
    case ENOTSUP:
      return {CameraFault::kUnsupported, "set another format or size, or use another camera"};
    default:
      return {CameraFault::kStreamError,
              "set LIBCAMERA_LOG_LEVELS=*:INFO to see what libcamera says"};
  }
}

}  // namespace

CameraError lost_camera(CameraFault fault, std::string message, int code) {
  CameraError error;
  error.fault = fault;
  error.message = std::move(message);
  error.code = code;
  error.lost = true;
  return error;
}

CameraError libcamera_failure(const std::string& id, const std::string& what, int status) {
  const int code = std::abs(status);
  const Cause cause = cause_of(code);
  return lost_camera(cause.fault,
                     "cannot use the camera " + id + ": " + what + " (" +
                         std::generic_category().message(code) + "); " + cause.remedy,
                     code);
}

}  // namespace loopd
