// What libcamera_driver.h offers, by loopd-libcamera.so where that is installed.

#include <dlfcn.h>

#include <cerrno>
#include <filesystem>
#include <optional>
#include <utility>

#include "capture/libcamera_driver.h"
#include "capture/libcamera_error.h"
#include "capture/libcamera_plugin.h"

namespace loopd {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFile = "lib/loopd/loopd-libcamera.so";

/// Beside the programs: PREFIX/bin and PREFIX/lib, or the tree they were built in.
std::optional<std::string> plugin_file() {
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  for (const char* up : {"..", "../.."}) {
    const fs::path file = folder / up / kFile;
    if (!error && fs::exists(file, error)) return file.string();
  }
  return std::nullopt;
}

Error unusable(const std::string& file, const std::string& why) {
  return {"cannot load " + file + ": " + why + "; install loopd and loopd-libcamera of one version",
          ENOTSUP};
}

/// Loads the plugin, or finds it loaded; for good.
Result<const LibcameraPlugin*> load_plugin() {
  const std::optional<std::string> file = plugin_file();
  if (!file)
    return Error{
        "this loopd has no libcamera; install the package loopd-libcamera, build with "
        "libcamera-dev, or use camera.source = \"v4l2\"",
        ENOTSUP};
  void* const library = dlopen(file->c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
  if (library == nullptr) return unusable(*file, dlerror());
  using Entry = decltype(&loopd_libcamera_plugin);
  const auto entry = reinterpret_cast<Entry>(dlsym(library, kLibcameraPluginEntry));
  if (entry == nullptr) return unusable(*file, "it is no part of loopd");
  const LibcameraPlugin* const plugin = entry();
  if (std::string(plugin->made_for) != libcamera_plugin_made_for())
    return unusable(*file, std::string("it belongs to another loopd, ") + plugin->made_for);
  return plugin;
}

/// Loads the plugin when it is asked to open a camera, in the thread that asks.
class LoadingDriver final : public CaptureDriver {
 public:
  explicit LoadingDriver(LibcameraOptions options) : options_(std::move(options)) {}

  Opened open() override {
    if (!driver_) {
      const Result<const LibcameraPlugin*> plugin = load_plugin();
      if (!plugin)
        return lost_camera(CameraFault::kUnsupported, plugin.error().message, plugin.error().code);
      driver_ = plugin.value()->make_driver(options_);
    }
    return driver_->open();
  }

  int hotplug_fd() const override { return driver_ ? driver_->hotplug_fd() : -1; }
  void acknowledge() override {
    if (driver_) driver_->acknowledge();
  }

  std::string describe() const override {
    return options_.camera.empty() ? "first libcamera camera"
                                   : "libcamera camera " + options_.camera;
  }

 private:
  const LibcameraOptions options_;
  std::unique_ptr<CaptureDriver> driver_;
};

}  // namespace

LibcameraBuild libcamera_build() {
  const Result<const LibcameraPlugin*> plugin = load_plugin();
  if (!plugin) return {false, plugin.error().message};
  return plugin.value()->build();
}

std::unique_ptr<CaptureDriver> make_libcamera_driver(const LibcameraOptions& options) {
  return std::make_unique<LoadingDriver>(options);
}

Result<std::vector<CameraListing>> list_libcamera_cameras() {
  const Result<const LibcameraPlugin*> plugin = load_plugin();
  if (!plugin) return plugin.error();
  return plugin.value()->list();
}

}  // namespace loopd
