// What libcamera_driver.h offers in a build without libcamera: the same, but that it says so.

#include <cerrno>

#include "capture/libcamera_driver.h"
#include "capture/libcamera_error.h"

namespace loopd {
namespace {

constexpr const char* kAbsent =
    "this build has no libcamera; install libcamera-dev and build again, or use the V4L2 driver";

class AbsentDriver final : public CaptureDriver {
 public:
  explicit AbsentDriver(std::string camera) : camera_(std::move(camera)) {}

  Opened open() override { return lost_camera(CameraFault::kUnsupported, kAbsent, ENOTSUP); }

  std::string describe() const override { return "libcamera camera " + camera_; }

 private:
  std::string camera_;
};

}  // namespace

LibcameraBuild libcamera_build() { return {false, kAbsent}; }

std::unique_ptr<CaptureDriver> make_libcamera_driver(const LibcameraOptions& options) {
  return std::make_unique<AbsentDriver>(options.camera);
}

Result<std::vector<CameraListing>> list_libcamera_cameras() { return Error{kAbsent, ENOTSUP}; }

}  // namespace loopd
