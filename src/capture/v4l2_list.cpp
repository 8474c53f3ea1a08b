#include "capture/v4l2_list.h"

#include <linux/videodev2.h>

#include <array>
#include <cstdio>
#include <optional>

#include "capture/v4l2_error.h"
#include "capture/v4l2_setup.h"
#include "capture/v4l2_sysfs.h"

namespace loopd {
namespace {

// Asking for no buffers frees none of ours, as there are none, and fails if another program has
// some.
std::string busy_problem(const V4l2Context& context, std::uint32_t type) {
  v4l2_requestbuffers none{};
  none.type = type;
  none.memory = V4L2_MEMORY_MMAP;
  const int result = context.node.call(VIDIOC_REQBUFS, none);
  if (result >= 0) return {};
  return v4l2_error(context.paths, context.path, "get buffers of", result).message;
}

// None if the node is not for capturing.
std::optional<CameraListing> list_node(V4l2Io& io, const V4l2Paths& paths,
                                       const std::string& name) {
  CameraListing listing;
  listing.node = paths.dev + "/" + name;
  listing.links = stable_links(paths, listing.node);
  const SysfsDevice device = sysfs_device(paths, name);
  listing.serial = device.serial;
  int failure = 0;
  const V4l2Node node = V4l2Node::open(io, listing.node, failure);
  if (!node.valid()) {
    listing.problem = v4l2_error(paths, listing.node, "open", failure).message;
    return listing;
  }
  const V4l2Context context{node, paths, listing.node};
  V4l2Capability capability;
  if (const auto error = check_capture_node(context, capability)) {
    if (error->fault == CameraFault::kUnsupported) return std::nullopt;
    listing.problem = error->message;
    return listing;
  }
  listing.name = capability.card;
  listing.driver = capability.driver;
  listing.bus = capability.bus_info;
  listing.id = stable_id(device, capability.bus_info, capability.card);
  listing.modes = list_modes(node, capability.type, ListSizes::kOfAll);
  listing.problem = busy_problem(context, capability.type);
  return listing;
}

std::string rates_text(const std::vector<double>& rates) {
  std::string text;
  for (const double fps : rates) {
    std::array<char, 32> number{};
    std::snprintf(number.data(), number.size(), "%.4g", fps);
    text += (text.empty() ? "" : ", ") + std::string(number.data());
  }
  return text.empty() ? text : " (" + text + " fps)";
}

}  // namespace

std::vector<CameraListing> list_v4l2_cameras() {
  KernelV4l2Io io;
  return list_v4l2_cameras(io, V4l2Paths{});
}

std::vector<CameraListing> list_v4l2_cameras(V4l2Io& io, const V4l2Paths& paths) {
  std::vector<CameraListing> listings;
  for (const std::string& name : list_video_names(paths))
    if (auto listing = list_node(io, paths, name)) listings.push_back(*std::move(listing));
  return listings;
}

std::string mode_text(const V4l2Mode& mode) {
  std::string text = fourcc_text(mode.fourcc);
  for (const V4l2Size& size : mode.sizes)
    text += (&size == mode.sizes.data() ? "  " : ", ") + std::to_string(size.width_px) + "x" +
            std::to_string(size.height_px) + rates_text(size.fps);
  if (mode.range)
    text += "  " + std::to_string(mode.range->min_width_px) + "x" +
            std::to_string(mode.range->min_height_px) + " to " +
            std::to_string(mode.range->max_width_px) + "x" +
            std::to_string(mode.range->max_height_px);
  return text;
}

}  // namespace loopd
