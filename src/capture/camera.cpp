#include "capture/camera.h"

namespace loopd {

std::string_view camera_fault_name(CameraFault fault) {
  switch (fault) {
    case CameraFault::kNoDevice:
      return "no_device";
    case CameraFault::kPermission:
      return "permission";
    case CameraFault::kBusy:
      return "busy";
    case CameraFault::kUnsupported:
      return "unsupported";
    case CameraFault::kCorruptFrame:
      return "corrupt_frame";
    case CameraFault::kTooLarge:
      return "too_large";
    case CameraFault::kStalled:
      return "stalled";
    case CameraFault::kNoSignal:
      return "no_signal";
    case CameraFault::kUnplugged:
      return "unplugged";
    case CameraFault::kStreamError:
      return "stream_error";
  }
  return "unknown";
}

}  // namespace loopd
