#include "capture/libcamera_manager.h"

#include <dirent.h>
#include <libcamera/logging.h>
#include <libcamera/property_ids.h>
#include <libcamera/stream.h>
#include <libcamera/version.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace loopd {

/// The right to have the one CameraManager of this process; libcamera ends a process that makes
/// two.
class LibcameraManager::Lease {
 public:
  static std::unique_ptr<Lease> take() {
    if (taken().exchange(true)) return nullptr;
    return std::unique_ptr<Lease>(new Lease);
  }
  ~Lease() { taken() = false; }
  Lease(const Lease&) = delete;
  Lease& operator=(const Lease&) = delete;

 private:
  Lease() = default;
  // The limit is the process's, so what keeps it is too.
  static std::atomic<bool>& taken() {
    static std::atomic<bool> taken_flag{false};
    return taken_flag;
  }
};

namespace {

// Libraries never log; who wants to see what libcamera does asks it in its own way.
void quieten_libcamera() {
  if (std::getenv("LIBCAMERA_LOG_LEVELS") == nullptr &&
      std::getenv("LIBCAMERA_LOG_FILE") == nullptr)
    libcamera::logSetTarget(libcamera::LoggingTargetNone);
}

// Up to 0.1 the manager finds a camera by the number of its node; later ones tell the numbers.
template <class Manager>
bool belongs(Manager& manager, const libcamera::Camera& camera, dev_t number) {
  if constexpr (requires { manager.get(number); }) {
    return manager.get(number).get() == &camera;
  } else {
#if LIBCAMERA_VERSION_MAJOR > 0 || LIBCAMERA_VERSION_MINOR >= 2
    const auto numbers = camera.properties().get(libcamera::properties::SystemDevices);
    return numbers && std::find(numbers->begin(), numbers->end(),
                                static_cast<std::int64_t>(number)) != numbers->end();
#else
    return false;
#endif
  }
}

// The folder of sysfs of the device behind a node; empty if there is none.
std::filesystem::path device_folder(const CameraNode& node) {
  std::error_code error;
  auto folder = std::filesystem::canonical("/sys/dev/char/" + std::to_string(major(node.number)) +
                                               ":" + std::to_string(minor(node.number)) + "/device",
                                           error);
  return error ? std::filesystem::path() : folder;
}

FrameSize frame_size(const libcamera::Size& size) {
  const auto bounded = [](unsigned value) {
    return static_cast<int>(std::min<unsigned>(value, INT_MAX));
  };
  return {bounded(size.width), bounded(size.height)};
}

}  // namespace

LibcameraManager::LibcameraManager(std::unique_ptr<Lease> lease,
                                   std::unique_ptr<libcamera::CameraManager> manager)
    : lease_(std::move(lease)), manager_(std::move(manager)) {}

Result<std::shared_ptr<LibcameraManager>> LibcameraManager::start() {
  auto lease = Lease::take();
  if (!lease)
    return Error{"cannot start libcamera: this process uses it already, and it can be used once",
                 EBUSY};
  quieten_libcamera();
  auto manager = std::make_unique<libcamera::CameraManager>();
  const int status = manager->start();
  if (status < 0) {
    manager.reset();  // before the lease
    return errno_error("cannot start libcamera", -status);
  }
  return std::shared_ptr<LibcameraManager>(
      new LibcameraManager(std::move(lease), std::move(manager)));
}

LibcameraManager::~LibcameraManager() {
  manager_->stop();
  manager_.reset();
}

std::vector<CameraNode> LibcameraManager::nodes(const libcamera::Camera& camera) const {
  std::vector<CameraNode> nodes = video_nodes();
  std::erase_if(nodes,
                [&](const CameraNode& node) { return !belongs(*manager_, camera, node.number); });
  return nodes;
}

std::vector<CameraNode> video_nodes() {
  std::vector<CameraNode> nodes;
  DIR* const folder = ::opendir("/dev");
  if (folder == nullptr) return nodes;
  while (const dirent* const entry = ::readdir(folder)) {
    const std::string name = entry->d_name;
    struct stat status {};
    if (name.rfind("video", 0) != 0) continue;
    if (::stat(("/dev/" + name).c_str(), &status) == 0 && S_ISCHR(status.st_mode))
      nodes.push_back({name, status.st_rdev});
  }
  ::closedir(folder);
  std::sort(nodes.begin(), nodes.end(), [](const CameraNode& a, const CameraNode& b) {
    return minor(a.number) < minor(b.number);
  });
  return nodes;
}

CameraName camera_name(const libcamera::Camera& camera) {
  const auto model = camera.properties().get(libcamera::properties::Model);
  return {camera.id(), model ? std::string(*model) : std::string()};
}

std::string stable_id(const libcamera::Camera& camera, const std::vector<CameraNode>& nodes) {
  if (nodes.empty()) return camera.id();
  std::ifstream file(device_folder(nodes.front()).parent_path() / "serial");
  std::string serial;
  if (!std::getline(file, serial) || serial.empty()) return camera.id();
  return camera.id() + " serial " + serial;
}

bool behind_usb(const std::vector<CameraNode>& nodes) {
  return !nodes.empty() && device_folder(nodes.front()).string().find("/usb") != std::string::npos;
}

std::vector<FormatOffer> format_offers(const libcamera::StreamFormats& formats) {
  std::vector<FormatOffer> offers;
  for (const libcamera::PixelFormat& format : formats.pixelformats()) {
    FormatOffer offer;
    offer.code = format.fourcc();
    offer.modifier = format.modifier();
    for (const libcamera::Size& size : formats.sizes(format))
      offer.sizes.push_back(frame_size(size));
    const libcamera::SizeRange range = formats.range(format);
    offer.smallest = frame_size(range.min);
    offer.largest = frame_size(range.max);
    offer.step = {static_cast<int>(std::min<unsigned>(range.hStep, INT_MAX)),
                  static_cast<int>(std::min<unsigned>(range.vStep, INT_MAX))};
    offers.push_back(std::move(offer));
  }
  return offers;
}

}  // namespace loopd
