#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "capture/v4l2_io.h"

namespace loopd {

// What the kernel shows of video nodes in /sys, /dev and /proc, read without opening any of them.
// All of it may change or vanish at any moment; what cannot be read is left out. Reentrant.

/// "video0" of all video nodes, in the order of their numbers.
std::vector<std::string> list_video_names(const V4l2Paths& paths);

/// "video0" of a node's path or of a link to it; empty if it leads nowhere.
std::string video_name(const std::string& path);

/// Places of a video node on the bus.
struct SysfsDevice {
  std::string folder;  ///< of the device in /sys, links resolved; nodes of one device share it
  int index = 0;       ///< which of the device's nodes
  std::string vendor;  ///< the rest of USB devices only
  std::string product;
  std::string serial;
  std::string interface_number;
  std::string usb_port;  ///< "1-2.3"
};
SysfsDevice sysfs_device(const V4l2Paths& paths, const std::string& name);

/// An id that stays with the camera: "usb-046d:0825-SN0001-00" (vendor, product, serial number or
/// else the port, interface), and for what is no USB device "platform:vivid-000-vivid": the bus and
/// name that the driver gives.
std::string stable_id(const SysfsDevice& device, const std::string& bus_info,
                      const std::string& card);

/// The node that options.camera means: a path as it is, "serial:X" looked up; empty if there is no
/// such serial number.
std::string resolve_camera(const V4l2Paths& paths, const std::string& camera);

/// Other nodes ("/dev/video1") of the same device, in the order of their index.
std::vector<std::string> sibling_nodes(const V4l2Paths& paths, const std::string& node);

/// Links below /dev/v4l that lead to `node`.
std::vector<std::string> stable_links(const V4l2Paths& paths, const std::string& node);

/// Who else has `node` open, as far as this process may see: "process 123 (guvcview)"; empty if
/// nobody is seen.
std::string node_users(const V4l2Paths& paths, const std::string& node);

/// The name of the group that owns `node`; empty if not known.
std::string owning_group(const std::string& node);

}  // namespace loopd
