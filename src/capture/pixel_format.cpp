#include <algorithm>
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

int luma_cost(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGrey:
      return 0;
    case PixelFormat::kNv12:
    case PixelFormat::kYu12:
      return 1;
    case PixelFormat::kYuyv:
    case PixelFormat::kUyvy:
      return 2;
    case PixelFormat::kY10:
    case PixelFormat::kY16:
      return 3;
    case PixelFormat::kRgb24:
    case PixelFormat::kBgr24:
      return 4;
    case PixelFormat::kMjpeg:
      break;
  }
  return 5;
}

int nearest_in_steps(int wish, int least, int most, int step) {
  const int clamped = std::clamp(wish, least, most);
  const int below = least + (clamped - least) / step * step;
  return clamped - below > step / 2 && most - below >= step ? below + step : below;
}

}  // namespace loopd
