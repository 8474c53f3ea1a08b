#include "capture/libcamera_driver.h"

#include <fcntl.h>
#include <libcamera/camera_manager.h>
#include <libcamera/stream.h>

#include <cerrno>
#include <string>

#include "base/unique_fd.h"
#include "capture/libcamera_dev_watch.h"
#include "capture/libcamera_device.h"
#include "capture/libcamera_error.h"
#include "capture/libcamera_manager.h"
#include "capture/libcamera_plugin.h"
#include "capture/libcamera_selection.h"

namespace loopd {
namespace {

CameraError not_started(const Error& error) {
  return lost_camera(error.code == EBUSY ? CameraFault::kBusy : CameraFault::kStreamError,
                     error.message, error.code);
}

// libcamera passes over in silence what it may not open. A media device that this process may not
// open is a better reason than "no camera".
std::optional<CameraError> forbidden_media_device() {
  for (int i = 0; i < 64; ++i) {
    const std::string path = "/dev/media" + std::to_string(i);
    const UniqueFd fd(::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
    const int code = errno;
    if (fd.valid() || (code != EACCES && code != EPERM)) continue;
    return lost_camera(CameraFault::kPermission,
                       "libcamera sees no camera that fits, and may not open " + path +
                           "; let this user read and write it (group video, DeviceAllow= of the "
                           "service)",
                       code);
  }
  return std::nullopt;
}

std::vector<CameraName> names_of(const std::vector<std::shared_ptr<libcamera::Camera>>& cameras) {
  std::vector<CameraName> names;
  for (const auto& camera : cameras) names.push_back(camera_name(*camera));
  return names;
}

class LibcameraDriver final : public CaptureDriver {
 public:
  explicit LibcameraDriver(const LibcameraOptions& options)
      : options_(options), selection_(options.camera) {}

  Opened open() override {
    DevWatch watch;  // before the cameras are looked at: nothing that goes from then on is missed
    auto started = LibcameraManager::start();
    if (!started) return not_started(started.error());
    // Declared before the cameras, so that it outlives them whatever fails.
    const std::shared_ptr<LibcameraManager> manager = std::move(started).value();
    const auto cameras = manager->cameras();
    const std::vector<CameraName> names = names_of(cameras);
    const CameraSelection::Choice choice = selection_.choose(names);
    if (const auto* error = std::get_if<CameraError>(&choice))
      return forbidden_media_device().value_or(*error);
    const std::size_t index = std::get<std::size_t>(choice);
    Opened opened = LibcameraDevice::open(manager, cameras[index], std::move(watch), options_);
    if (std::holds_alternative<std::unique_ptr<CaptureDevice>>(opened))
      selection_.keep(names, index);
    return opened;
  }

  int hotplug_fd() const override { return watch_.fd(); }
  void acknowledge() override { watch_.acknowledge(); }

  std::string describe() const override {
    return options_.camera.empty() ? "first libcamera camera"
                                   : "libcamera camera " + options_.camera;
  }

 private:
  LibcameraOptions options_;
  CameraSelection selection_;
  DevWatch watch_;
};

V4l2Mode mode_of(const FormatOffer& offer) {
  V4l2Mode mode;
  mode.format = pixel_format_from_drm(offer.code, offer.modifier);
  mode.fourcc = offer.code;
  if (mode.format) {
    const std::string_view name = pixel_format_name(*mode.format);
    mode.fourcc = fourcc(name[0], name[1], name[2], name[3]);
  }
  for (const FrameSize& size : offer.sizes)
    mode.sizes.push_back({size.width_px, size.height_px, {}});
  if (offer.sizes.empty() && offer.step.width_px > 0 && offer.step.height_px > 0)
    mode.range =
        V4l2SizeRange{offer.smallest.width_px,  offer.largest.width_px,  offer.step.width_px,
                      offer.smallest.height_px, offer.largest.height_px, offer.step.height_px};
  return mode;
}

CameraListing listing_of(const LibcameraManager& manager, libcamera::Camera& camera) {
  const std::vector<CameraNode> nodes = manager.nodes(camera);
  CameraListing listing;
  listing.node = camera.id();
  listing.id = stable_id(camera, nodes);
  listing.name = camera_name(camera).model;
  listing.driver = "libcamera";
  for (const CameraNode& node : nodes)
    listing.bus += (listing.bus.empty() ? "/dev/" : " /dev/") + node.name;
  const auto config = camera.generateConfiguration({libcamera::StreamRole::Viewfinder});
  if (!config || config->empty()) {
    listing.problem = "libcamera offers no stream of it for viewing; use another camera";
    return listing;
  }
  for (const FormatOffer& offer : format_offers(config->at(0).formats()))
    listing.modes.push_back(mode_of(offer));
  return listing;
}

LibcameraBuild build() { return {true, "libcamera " + libcamera::CameraManager::version()}; }

std::unique_ptr<CaptureDriver> make_driver(const LibcameraOptions& options) {
  return std::make_unique<LibcameraDriver>(options);
}

Result<std::vector<CameraListing>> list() {
  auto manager = LibcameraManager::start();
  if (!manager) return manager.error();
  std::vector<CameraListing> listings;
  for (const auto& camera : manager.value()->cameras())
    listings.push_back(listing_of(*manager.value(), *camera));
  return listings;
}

}  // namespace
}  // namespace loopd

[[gnu::visibility("default")]] const loopd::LibcameraPlugin* loopd_libcamera_plugin() {
  static constexpr loopd::LibcameraPlugin kPlugin{loopd::libcamera_plugin_made_for(), &loopd::build,
                                                  &loopd::make_driver, &loopd::list};
  return &kPlugin;
}
