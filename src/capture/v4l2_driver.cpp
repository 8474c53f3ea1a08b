#include "capture/v4l2_driver.h"

#include <cerrno>
#include <filesystem>
#include <system_error>

#include "capture/v4l2_device.h"
#include "capture/v4l2_error.h"
#include "capture/v4l2_sysfs.h"
#include "capture/v4l2_watch.h"

namespace loopd {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> watched_folders(const V4l2Paths& paths, const std::string& camera) {
  std::vector<std::string> folders{paths.dev, paths.dev + "/v4l", paths.dev + "/v4l/by-id",
                                   paths.dev + "/v4l/by-path"};
  if (camera.starts_with("/")) folders.push_back(fs::path(camera).parent_path());
  return folders;
}

class V4l2Driver final : public CaptureDriver {
 public:
  /// `own_io` may be null, if somebody else owns `io`.
  V4l2Driver(const V4l2Options& options, std::unique_ptr<V4l2Io> own_io, V4l2Io& io,
             const V4l2Paths& paths)
      : options_(options),
        own_io_(std::move(own_io)),
        io_(io),
        paths_(paths),
        watch_(watched_folders(paths, options.camera)) {}

  Opened open() override {
    const std::string path = resolve_camera(paths_, options_.camera);
    if (path.empty())
      return v4l2_fault(CameraFault::kNoDevice, "\"" + options_.camera + "\"",
                        "names no camera that is there; plug it in, or correct camera.path "
                        "(loopctl cameras)");
    std::error_code failure;
    const fs::path node = fs::canonical(path, failure);
    if (failure) return v4l2_error(paths_, path, "find", -failure.value());
    return V4l2Device::open(options_, io_, paths_, node);
  }

  int hotplug_fd() const override { return watch_.fd(); }
  void acknowledge() override { watch_.acknowledge(); }
  std::string describe() const override { return "V4L2 camera " + options_.camera; }

 private:
  const V4l2Options options_;
  const std::unique_ptr<V4l2Io> own_io_;
  V4l2Io& io_;
  const V4l2Paths paths_;
  FolderWatch watch_;
};

}  // namespace

std::unique_ptr<CaptureDriver> make_v4l2_driver(const V4l2Options& options) {
  auto io = std::make_unique<KernelV4l2Io>();
  V4l2Io& kernel = *io;
  return std::make_unique<V4l2Driver>(options, std::move(io), kernel, V4l2Paths{});
}

std::unique_ptr<CaptureDriver> make_v4l2_driver(const V4l2Options& options, V4l2Io& io,
                                                const V4l2Paths& paths) {
  return std::make_unique<V4l2Driver>(options, nullptr, io, paths);
}

}  // namespace loopd
