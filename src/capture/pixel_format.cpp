#include <array>
#include <utility>

#include "capture/capture_device.h"

namespace loopd {
namespace {

constexpr std::array<std::pair<PixelFormat, std::string_view>, 10> kNames{{
    {PixelFormat::kGrey, "GREY"},
    {PixelFormat::kY10, "Y10 "},
    {PixelFormat::kY16, "Y16 "},
    {PixelFormat::kNv12, "NV12"},
    {PixelFormat::kYu12, "YU12"},
    {PixelFormat::kYuyv, "YUYV"},
    {PixelFormat::kUyvy, "UYVY"},
    {PixelFormat::kRgb24, "RGB3"},
    {PixelFormat::kBgr24, "BGR3"},
    {PixelFormat::kMjpeg, "MJPG"},
}};

// "Y10 " is written "Y10" by people.
std::string_view without_padding(std::string_view name) {
  while (!name.empty() && name.back() == ' ') name.remove_suffix(1);
  return name;
}

}  // namespace

std::string_view pixel_format_name(PixelFormat format) {
  for (const auto& [candidate, name] : kNames)
    if (candidate == format) return name;
  return "unknown";
}

std::optional<PixelFormat> pixel_format_from_name(std::string_view name) {
  if (name.size() > 4) return std::nullopt;
  for (const auto& [format, candidate] : kNames)
    if (without_padding(candidate) == without_padding(name)) return format;
  return std::nullopt;
}

}  // namespace loopd
