#include "capture/v4l2_sysfs.h"

#include <grp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <system_error>

namespace loopd {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kSerialPrefix = "serial:";
constexpr int kMaxDepth = 32;  // of a device in /sys

// One attribute without its line feed; empty if it is not there. Bounded: it is written by devices.
std::string attribute(const fs::path& file) {
  std::ifstream stream(file);
  std::array<char, 256> text{};
  stream.read(text.data(), text.size());
  std::string value(text.data(), static_cast<std::size_t>(stream.gcount()));
  value.resize(std::min(value.find('\n'), value.size()));
  for (char& letter : value)
    if (static_cast<unsigned char>(letter) < ' ' || letter == '\x7f') letter = '_';
  return value;
}

fs::path resolved(const fs::path& path) {
  std::error_code failure;
  fs::path result = fs::canonical(path, failure);
  return failure ? fs::path() : result;
}

std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> paths;
  std::error_code failure;
  for (fs::directory_iterator at(folder, failure), end; !failure && at != end;
       at.increment(failure))
    paths.push_back(at->path());
  return paths;
}

std::optional<long> number_after(std::string_view prefix, std::string_view text) {
  if (!text.starts_with(prefix)) return std::nullopt;
  text.remove_prefix(prefix.size());
  long number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number < 0) return std::nullopt;
  return number;
}

// The USB device that `folder` belongs to, and the interface of it on the way up to `top`.
void add_usb(SysfsDevice& device, fs::path folder, const fs::path& top) {
  for (int depth = 0; depth < kMaxDepth && folder != top; ++depth) {
    if (device.interface_number.empty())
      device.interface_number = attribute(folder / "bInterfaceNumber");
    if (std::string vendor = attribute(folder / "idVendor"); !vendor.empty()) {
      device.vendor = std::move(vendor);
      device.product = attribute(folder / "idProduct");
      device.serial = attribute(folder / "serial");
      device.usb_port = folder.filename();
      return;
    }
    folder = folder.parent_path();
  }
}

std::string find_serial(const V4l2Paths& paths, std::string_view serial) {
  std::optional<std::pair<int, std::string>> best;
  for (const std::string& name : list_video_names(paths)) {
    const SysfsDevice device = sysfs_device(paths, name);
    if (device.serial != serial) continue;
    if (!best || device.index < best->first) best.emplace(device.index, name);
  }
  return best ? paths.dev + "/" + best->second : std::string();
}

bool has_open(const fs::path& process, const fs::path& node) {
  for (const fs::path& descriptor : entries(process / "fd")) {
    std::error_code failure;
    if (fs::read_symlink(descriptor, failure) == node) return true;
  }
  return false;
}

}  // namespace

std::vector<std::string> list_video_names(const V4l2Paths& paths) {
  std::vector<std::pair<long, std::string>> numbered;
  for (const fs::path& entry : entries(paths.sys + "/class/video4linux")) {
    const std::string name = entry.filename();
    if (const auto number = number_after("video", name)) numbered.emplace_back(*number, name);
  }
  std::sort(numbered.begin(), numbered.end());
  std::vector<std::string> names;
  for (auto& [number, name] : numbered) names.push_back(std::move(name));
  return names;
}

std::string video_name(const std::string& path) { return resolved(path).filename(); }

SysfsDevice sysfs_device(const V4l2Paths& paths, const std::string& name) {
  SysfsDevice device;
  if (name.empty()) return device;
  const fs::path node = fs::path(paths.sys) / "class/video4linux" / name;
  const fs::path folder = resolved(node / "device");
  if (folder.empty()) return device;
  device.folder = folder;
  device.index = static_cast<int>(number_after("", attribute(node / "index")).value_or(0));
  add_usb(device, folder, resolved(paths.sys + "/devices"));
  return device;
}

std::string stable_id(const SysfsDevice& device, const std::string& bus_info,
                      const std::string& card) {
  if (device.vendor.empty()) return bus_info + "-" + card;
  std::string id = "usb-" + device.vendor + ":" + device.product + "-";
  id += device.serial.empty() ? "port-" + device.usb_port : device.serial;
  if (!device.interface_number.empty()) id += "-" + device.interface_number;
  return id;
}

std::string resolve_camera(const V4l2Paths& paths, const std::string& camera) {
  if (!camera.starts_with(kSerialPrefix)) return camera;
  return find_serial(paths, std::string_view(camera).substr(kSerialPrefix.size()));
}

std::vector<std::string> sibling_nodes(const V4l2Paths& paths, const std::string& node) {
  const std::string own_name = video_name(node);
  const SysfsDevice own = sysfs_device(paths, own_name);
  std::vector<std::pair<int, std::string>> found;
  if (own.folder.empty()) return {};
  for (const std::string& name : list_video_names(paths)) {
    const SysfsDevice device = sysfs_device(paths, name);
    if (name != own_name && device.folder == own.folder)
      found.emplace_back(device.index, paths.dev + "/" + name);
  }
  std::sort(found.begin(), found.end());
  std::vector<std::string> nodes;
  for (auto& [index, path] : found) nodes.push_back(std::move(path));
  return nodes;
}

std::vector<std::string> stable_links(const V4l2Paths& paths, const std::string& node) {
  const fs::path target = resolved(node);
  std::vector<std::string> links;
  if (target.empty()) return links;
  for (const char* folder : {"/v4l/by-id", "/v4l/by-path"})
    for (const fs::path& link : entries(paths.dev + folder))
      if (resolved(link) == target) links.push_back(link);
  std::sort(links.begin(), links.end());
  return links;
}

std::string node_users(const V4l2Paths& paths, const std::string& node) {
  const fs::path target = resolved(node);
  if (target.empty()) return {};
  std::string users;
  for (const fs::path& process : entries(paths.proc)) {
    const auto id = number_after("", process.filename().string());
    if (!id || *id == ::getpid() || !has_open(process, target)) continue;
    users += (users.empty() ? "process " : ", process ") + std::to_string(*id) + " (" +
             attribute(process / "comm") + ")";
  }
  return users;
}

std::string owning_group(const std::string& node) {
  struct stat status {};
  if (::stat(node.c_str(), &status) != 0) return {};
  std::array<char, 4096> memory{};
  group entry{};
  group* found = nullptr;
  if (::getgrgid_r(status.st_gid, &entry, memory.data(), memory.size(), &found) != 0 ||
      found == nullptr)
    return "gid " + std::to_string(status.st_gid);
  return found->gr_name;
}

}  // namespace loopd
