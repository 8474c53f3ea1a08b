#include "loopctl/doctor_camera.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <limits>

#include "capture/v4l2_sysfs.h"
#include "loopctl/cameras.h"

namespace loopd::loopctl {

namespace {

constexpr const char* kTopic = "camera";
constexpr const char* kSeeList = "correct camera.path; loopctl cameras lists what is there";
constexpr const char* kPlugOrCorrect =
    "plug the camera in, or correct camera.path; loopctl cameras lists what is there";

FoundCamera no_camera(std::string text, std::string remedy) {
  return {{Finding::problem(kTopic, std::move(text), std::move(remedy))}, std::nullopt};
}

FoundCamera missing_camera(const std::string& path) {
  if (path.starts_with("serial:"))
    return no_camera("no camera has the serial number " + path.substr(7), kPlugOrCorrect);
  return no_camera(path + " is not there", kPlugOrCorrect);
}

/// Whether a path means another camera after another order of plugging in.
Findings judge_path(const std::string& path, const CameraListing& listing,
                    const std::vector<CameraListing>& listings) {
  const std::string better = best_path(listing, listings);
  if (path != listing.node || better == listing.node) return {};
  return {Finding::warning(kTopic, path + " may be another camera after the next start",
                           "set camera.path = \"" + better + "\"")};
}

/// Whether `users` names a process that is not the daemon's.
bool others_use_it(const CameraUse& use) {
  std::string rest = use.users;
  while (!rest.empty()) {
    const std::size_t comma = std::min(rest.find(", process "), rest.size());
    const std::string user = rest.substr(0, comma);
    rest.erase(0, std::min(comma + 2, rest.size()));
    const bool is_daemon = use.daemon_pid != 0
                               ? user.starts_with("process " + std::to_string(use.daemon_pid) + " ")
                               : user.ends_with("(loopd)");
    if (!is_daemon) return true;
  }
  return false;
}

std::string size_text(const V4l2Size& size) {
  return std::to_string(size.width_px) + "x" + std::to_string(size.height_px);
}

std::string fps_text(double fps) { return decimal(fps, fps < 10 ? 1 : 0) + " frames/s"; }

/// The modes that would be chosen from: read here, and of the wished format if there is one.
std::vector<V4l2Mode> usable_modes(const CameraConfig& camera, const std::vector<V4l2Mode>& modes) {
  const auto wished = pixel_format_from_name(camera.format);
  std::vector<V4l2Mode> usable;
  for (const V4l2Mode& mode : modes) {
    if (mode.format && (camera.format == "auto" || mode.format == wished)) usable.push_back(mode);
  }
  return usable;
}

std::string format_names(const std::vector<V4l2Mode>& modes) {
  std::string text;
  for (const V4l2Mode& mode : modes) {
    text += (text.empty() ? "" : ", ") + fourcc_text(mode.fourcc);
    text.erase(text.find_last_not_of(' ') + 1);  // the padding of short codes
  }
  return text;
}

/// The best that any of `modes` has: the nearest size, and the fastest rate at it.
V4l2Size best_size(const CameraConfig& camera, const std::vector<V4l2Mode>& modes) {
  V4l2Wish wish;
  wish.width_px = camera.width;
  wish.height_px = camera.height;
  V4l2Size best;
  long best_distance = std::numeric_limits<long>::max();
  for (const V4l2Mode& mode : modes) {
    const V4l2Size size = nearest_size(mode, wish);
    const long distance =
        std::labs(size.width_px - wish.width_px) + std::labs(size.height_px - wish.height_px);
    if (distance > best_distance) continue;
    if (distance < best_distance || size.fastest() > best.fastest()) best = size;
    best_distance = distance;
  }
  return best;
}

Finding judge_size_and_rate(const CameraConfig& camera, const std::vector<V4l2Mode>& usable) {
  const std::string formats = format_names(usable);
  if (camera.width == 0 || camera.height == 0)
    return Finding::ok(kTopic, "it gives " + formats + ", at the size it is set to");
  const V4l2Size size = best_size(camera, usable);
  if (size.width_px != camera.width || size.height_px != camera.height) {
    return Finding::warning(kTopic,
                            "it has no " + std::to_string(camera.width) + "x" +
                                std::to_string(camera.height) + " but " + size_text(size),
                            "set camera.width and camera.height to that, or to what loopctl "
                            "cameras lists");
  }
  constexpr double kTolerance = 1.01;  // 29.97 for 30
  const double fastest = size.fastest();
  if (fastest > 0 && camera.fps > fastest * kTolerance) {
    return Finding::warning(kTopic,
                            "at " + size_text(size) + " it gives at most " + fps_text(fastest) +
                                ", not " + fps_text(camera.fps),
                            "lower camera.fps, or choose a smaller size");
  }
  return Finding::ok(kTopic, "it gives " + size_text(size) +
                                 (fastest > 0 ? " at up to " + fps_text(fastest) : "") + " in " +
                                 formats);
}

bool means(const std::string& path, const CameraListing& listing) {
  return listing.node.find(path) != std::string::npos ||
         listing.name.find(path) != std::string::npos;
}

}  // namespace

FoundCamera find_v4l2_camera(const CameraConfig& camera, const std::vector<CameraListing>& listings,
                             const V4l2Paths& paths) {
  const std::string path = resolve_camera(paths, camera.path);
  std::error_code failure;
  const auto node = std::filesystem::canonical(path, failure);
  if (path.empty() || failure) return missing_camera(camera.path);
  const auto found = std::ranges::find_if(listings, [&](const CameraListing& listing) {
    std::error_code ignored;
    return std::filesystem::canonical(listing.node, ignored) == node;
  });
  if (found == listings.end())
    return no_camera(camera.path + " is no node that images can be captured from", kSeeList);
  FoundCamera result{judge_path(camera.path, *found, listings), *found};
  const std::string name = found->name.empty() ? "" : ": " + found->name;
  result.findings.insert(result.findings.begin(),
                         Finding::ok(kTopic, camera.path + " is there" + name));
  return result;
}

JudgedUse judge_use(const std::string& node, const CameraUse& use) {
  if (others_use_it(use)) {
    const std::string text = node + " is in use by " + use.users;
    if (use.problem.empty())
      return {{Finding::warning(kTopic, text, "end what is not loopd, or it may take the camera")},
              false};
    return {{Finding::problem(kTopic, text, "end what is not loopd")}, false};
  }
  if (!use.users.empty() || (!use.problem.empty() && use.daemon_works))
    return {{Finding::ok(kTopic, "the daemon has it")}, false};
  if (!use.problem.empty())
    return {{Finding::problem(kTopic, use.problem, "")}, false};  // the remedy is in it
  return {{}, true};
}

Findings judge_modes(const CameraConfig& camera, const std::vector<V4l2Mode>& modes) {
  if (modes.empty()) return {Finding::skipped(kTopic, "the driver lists no formats")};
  const std::vector<V4l2Mode> usable = usable_modes(camera, modes);
  if (!usable.empty()) return {judge_size_and_rate(camera, usable)};
  if (camera.format == "auto")
    return {Finding::problem(kTopic,
                             "none of its formats can be read here (" + format_names(modes) + ")",
                             "try camera.source = \"libcamera\"")};
  return {Finding::problem(kTopic,
                           "it has no format " + camera.format + " but " + format_names(modes),
                           "set camera.format = \"auto\"")};
}

FoundCamera find_libcamera_camera(const CameraConfig& camera,
                                  const std::vector<CameraListing>& listings) {
  std::vector<CameraListing> meant;
  std::ranges::copy_if(listings, std::back_inserter(meant),
                       [&](const CameraListing& listing) { return means(camera.path, listing); });
  if (meant.empty() && camera.path.empty())
    return no_camera("libcamera finds no camera", "plug it in; loopctl cameras says what to check");
  if (meant.empty())
    return no_camera("libcamera finds no camera with \"" + camera.path + "\" in its id or name",
                     kPlugOrCorrect);
  FoundCamera found{{}, meant.front()};
  found.findings.push_back(
      meant.size() == 1
          ? Finding::ok(kTopic,
                        "libcamera has " + meant.front().name + " (" + meant.front().node + ")")
          : Finding::warning(kTopic,
                             "camera.path = \"" + camera.path + "\" may mean " +
                                 std::to_string(meant.size()) + " cameras of libcamera",
                             "set camera.path = \"" + meant.front().node + "\""));
  return found;
}

}  // namespace loopd::loopctl
