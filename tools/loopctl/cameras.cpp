#include "loopctl/cameras.h"

#include <algorithm>
#include <utility>

#include "app/parameter_text.h"

namespace loopd::loopctl {

namespace {

constexpr std::string_view kNone =
    "no camera found\n"
    "  USB: is it in the list of lsusb? If not, try another port and cable; if so, see what the\n"
    "       kernel says of it: dmesg | grep -i -e uvc -e video\n"
    "  CSI: is it enabled in the firmware's settings, and this build one with libcamera?\n"
    "  In a container or virtual machine: is the device handed in, with its /dev node?\n";

bool is_twin(const CameraListing& a, const CameraListing& b) {
  return a.bus != b.bus && a.name == b.name && a.serial == b.serial;
}

std::string link_below(const CameraListing& listing, std::string_view folder) {
  const auto found = std::ranges::find_if(listing.links, [&](const std::string& link) {
    return link.find(folder) != std::string::npos;
  });
  return found == listing.links.end() ? std::string() : *found;
}

std::string indented(const std::string& text, const std::string& margin) {
  std::string result;
  for (std::size_t start = 0; start < text.size();) {
    const std::size_t end = std::min(text.find('\n', start), text.size());
    result += margin + text.substr(start, end - start) + "\n";
    start = end + 1;
  }
  return result;
}

std::string row(const char* name, const std::string& text) {
  std::string line = "  " + std::string(name);
  line.resize(12, ' ');
  return line + printable(text) + "\n";
}

std::string choice(const std::string& source, const std::string& path) {
  return "  to use it, in /etc/loopd/NAME.toml:\n" +
         indented(config_snippet(source, path), "      ");
}

bool is_readable(const V4l2Mode& mode) { return mode.format.has_value(); }

/// "YUYV", without the blank that pads a short code.
std::string code_text(const V4l2Mode& mode) {
  std::string code = fourcc_text(mode.fourcc);
  code.erase(code.find_last_not_of(' ') + 1);
  return code;
}

/// Sizes and rates: what mode_text() tells beside the code.
std::string sizes_text(const V4l2Mode& mode) {
  return mode_text(mode).substr(fourcc_text(mode.fourcc).size());
}

/// Formats of the same sizes and rates share a line; those that cannot be read are only named.
std::string modes_text(const std::vector<V4l2Mode>& modes) {
  std::vector<std::pair<std::string, std::string>> lines;  // codes, and their sizes
  std::string unreadable;
  for (const V4l2Mode& mode : modes) {
    if (!is_readable(mode)) {
      unreadable += (unreadable.empty() ? "" : ", ") + code_text(mode);
    } else if (!lines.empty() && lines.back().second == sizes_text(mode)) {
      lines.back().first += ", " + code_text(mode);
    } else {
      lines.emplace_back(code_text(mode), sizes_text(mode));
    }
  }
  std::string text;
  for (const auto& [codes, sizes] : lines)
    text += row(text.empty() ? "formats" : "", codes + sizes);
  if (lines.empty() && !modes.empty()) text += row("formats", "none that can be read here");
  if (!unreadable.empty()) text += row("unread", unreadable);
  return text;
}

/// `path`: the camera.path that chooses it.
std::string listing_text(const std::string& source, const std::string& path,
                         const CameraListing& listing) {
  std::string text =
      printable(listing.node + ": " + (listing.name.empty() ? "camera" : listing.name)) + "\n";
  for (const std::string& link : listing.links) text += row("link", link);
  if (!listing.serial.empty()) text += row("serial", listing.serial);
  if (!listing.driver.empty()) text += row("driver", listing.driver + ", " + listing.bus);
  text += modes_text(listing.modes);
  if (!listing.problem.empty()) text += row("problem", listing.problem);
  return text + choice(source, path);
}

Json mode_json(const V4l2Mode& mode) {
  Json json{{"fourcc", fourcc_text(mode.fourcc)}, {"readable", is_readable(mode)}};
  json["sizes"] = Json::array();
  for (const V4l2Size& size : mode.sizes)
    json["sizes"].push_back(
        {{"width", size.width_px}, {"height", size.height_px}, {"fps", size.fps}});
  if (mode.range) {
    json["range"] = {{"min_width", mode.range->min_width_px},
                     {"max_width", mode.range->max_width_px},
                     {"min_height", mode.range->min_height_px},
                     {"max_height", mode.range->max_height_px}};
  }
  return json;
}

Json listing_json(const std::string& source, const std::string& path,
                  const CameraListing& listing) {
  Json json{{"source", source},          {"path", path},
            {"node", listing.node},      {"links", listing.links},
            {"id", listing.id},          {"name", listing.name},
            {"serial", listing.serial},  {"driver", listing.driver},
            {"bus", listing.bus},        {"formats", Json::array()},
            {"problem", listing.problem}};
  for (const V4l2Mode& mode : listing.modes) json["formats"].push_back(mode_json(mode));
  return json;
}

}  // namespace

CameraList find_cameras() {
  CameraList list;
  list.v4l2 = list_v4l2_cameras();
  list.build = libcamera_build();
  if (!list.build.present) return list;
  auto listings = list_libcamera_cameras();
  if (listings) {
    list.libcamera = std::move(listings).value();
  } else {
    list.libcamera_problem = listings.error().message;
  }
  return list;
}

std::string best_path(const CameraListing& listing, const std::vector<CameraListing>& all) {
  const bool unique =
      std::ranges::none_of(all, [&](const auto& other) { return is_twin(listing, other); });
  if (unique) {
    if (std::string link = link_below(listing, "/by-id/"); !link.empty()) return link;
    if (!listing.serial.empty()) return "serial:" + listing.serial;
  }
  std::string link = link_below(listing, "/by-path/");
  return link.empty() ? listing.node : link;
}

std::string config_snippet(const std::string& source, const std::string& path) {
  return "[camera]\nsource = " + toml_string(source) + "\npath = " + toml_string(path) + "\n";
}

std::string cameras_text(const CameraList& list) {
  std::string text;
  const auto add = [&text](const std::string& block) {
    text += (text.empty() ? "" : "\n") + block;
  };
  for (const CameraListing& listing : list.v4l2)
    add(listing_text("v4l2", best_path(listing, list.v4l2), listing));
  for (const CameraListing& listing : list.libcamera)
    add(listing_text("libcamera", listing.node, listing));
  if (text.empty()) text = kNone;
  if (!list.build.present) add("libcamera: " + list.build.text + "\n");
  if (!list.libcamera_problem.empty())
    add("libcamera: " + printable(list.libcamera_problem) + "\n");
  return text;
}

Json cameras_json(const CameraList& list) {
  Json json{{"cameras", Json::array()},
            {"libcamera", {{"present", list.build.present}, {"text", list.build.text}}}};
  for (const CameraListing& listing : list.v4l2)
    json["cameras"].push_back(listing_json("v4l2", best_path(listing, list.v4l2), listing));
  for (const CameraListing& listing : list.libcamera)
    json["cameras"].push_back(listing_json("libcamera", listing.node, listing));
  if (!list.libcamera_problem.empty()) json["libcamera"]["problem"] = list.libcamera_problem;
  return json;
}

int cameras(bool json, std::ostream& out) {
  const CameraList list = find_cameras();
  if (json) {
    out << dump(cameras_json(list)) << std::endl;
  } else {
    out << cameras_text(list) << std::flush;
  }
  return out && !(list.v4l2.empty() && list.libcamera.empty()) ? 0 : 1;
}

}  // namespace loopd::loopctl
