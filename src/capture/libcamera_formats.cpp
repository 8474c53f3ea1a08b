#include "capture/libcamera_formats.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <limits>
#include <tuple>

namespace loopd {
namespace {

struct Known {
  std::uint32_t code;
  PixelFormat format;
};

constexpr std::array<Known, 22> kKnown{{
    {fourcc('R', '8', ' ', ' '), PixelFormat::kGrey},
    {fourcc('R', '1', '0', ' '), PixelFormat::kY10},
    {fourcc('R', '1', '6', ' '), PixelFormat::kY16},
    {fourcc('N', 'V', '1', '2'), PixelFormat::kNv12},
    {fourcc('N', 'V', '2', '1'), PixelFormat::kNv12},
    {fourcc('N', 'V', '1', '6'), PixelFormat::kNv12},
    {fourcc('N', 'V', '6', '1'), PixelFormat::kNv12},
    {fourcc('N', 'V', '2', '4'), PixelFormat::kNv12},
    {fourcc('N', 'V', '4', '2'), PixelFormat::kNv12},
    {fourcc('Y', 'U', '1', '2'), PixelFormat::kYu12},
    {fourcc('Y', 'V', '1', '2'), PixelFormat::kYu12},
    {fourcc('Y', 'U', '1', '6'), PixelFormat::kYu12},
    {fourcc('Y', 'V', '1', '6'), PixelFormat::kYu12},
    {fourcc('Y', 'U', '2', '4'), PixelFormat::kYu12},
    {fourcc('Y', 'V', '2', '4'), PixelFormat::kYu12},
    {fourcc('Y', 'U', 'Y', 'V'), PixelFormat::kYuyv},
    {fourcc('Y', 'V', 'Y', 'U'), PixelFormat::kYuyv},
    {fourcc('U', 'Y', 'V', 'Y'), PixelFormat::kUyvy},
    {fourcc('V', 'Y', 'U', 'Y'), PixelFormat::kUyvy},
    {fourcc('B', 'G', '2', '4'), PixelFormat::kRgb24},
    {fourcc('R', 'G', '2', '4'), PixelFormat::kBgr24},
    {fourcc('M', 'J', 'P', 'G'), PixelFormat::kMjpeg},
}};

// Relative cost of the way to luma: a copy of rows, every second byte, three products a pixel, or
// an entropy decoder.
int cost(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGrey:
      return 0;
    case PixelFormat::kNv12:
    case PixelFormat::kYu12:
      return 1;  // as GREY, but the camera fills and the bus carries half as much again
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
      return 5;
  }
  return std::numeric_limits<int>::max();
}

std::int64_t distance(FrameSize a, FrameSize b) {
  return std::abs(std::int64_t{a.width_px} - b.width_px) +
         std::abs(std::int64_t{a.height_px} - b.height_px);
}

// The value of smallest, smallest + step, ... largest that is nearest to `wanted`.
int nearest_step(int wanted, int smallest, int largest, int step) {
  if (wanted <= smallest) return smallest;
  const int count = (std::min(wanted, largest) - smallest + step / 2) / step;
  const int rounded = smallest + count * step;
  return rounded > largest ? rounded - step : rounded;
}

std::optional<FrameSize> nearest_in_range(const FormatOffer& offer, FrameSize wanted) {
  if (offer.step.width_px <= 0 || offer.step.height_px <= 0) return std::nullopt;
  if (offer.smallest.width_px <= 0 || offer.largest.width_px < offer.smallest.width_px ||
      offer.smallest.height_px <= 0 || offer.largest.height_px < offer.smallest.height_px)
    return std::nullopt;
  return FrameSize{nearest_step(wanted.width_px, offer.smallest.width_px, offer.largest.width_px,
                                offer.step.width_px),
                   nearest_step(wanted.height_px, offer.smallest.height_px, offer.largest.height_px,
                                offer.step.height_px)};
}

FrameSize nearest_size(const FormatOffer& offer, FrameSize wanted) {
  std::optional<FrameSize> best = nearest_in_range(offer, wanted);
  for (const FrameSize& size : offer.sizes)
    if (!best || distance(size, wanted) < distance(*best, wanted)) best = size;
  return best.value_or(wanted);
}

}  // namespace

std::optional<PixelFormat> pixel_format_from_drm(std::uint32_t code, std::uint64_t modifier) {
  if (modifier != 0) return std::nullopt;
  for (const Known& known : kKnown)
    if (known.code == code) return known.format;
  return std::nullopt;
}

std::optional<FormatChoice> choose_format(std::span<const FormatOffer> offers,
                                          std::optional<PixelFormat> only, FrameSize wanted) {
  std::optional<FormatChoice> best;
  for (std::size_t i = 0; i < offers.size(); ++i) {
    const auto format = pixel_format_from_drm(offers[i].code, offers[i].modifier);
    if (!format || (only && *format != *only)) continue;
    const FormatChoice next{i, *format, nearest_size(offers[i], wanted)};
    const auto rank = [&](const FormatChoice& choice) {
      return std::tuple(distance(choice.size, wanted), cost(choice.format));
    };
    if (!best || rank(next) < rank(*best)) best = next;
  }
  return best;
}

}  // namespace loopd
