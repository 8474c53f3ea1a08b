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

std::int64_t distance(FrameSize a, FrameSize b) {
  return std::abs(std::int64_t{a.width_px} - b.width_px) +
         std::abs(std::int64_t{a.height_px} - b.height_px);
}

std::optional<FrameSize> nearest_in_range(const FormatOffer& offer, FrameSize wanted) {
  if (offer.step.width_px <= 0 || offer.step.height_px <= 0) return std::nullopt;
  if (offer.smallest.width_px <= 0 || offer.largest.width_px < offer.smallest.width_px ||
      offer.smallest.height_px <= 0 || offer.largest.height_px < offer.smallest.height_px)
    return std::nullopt;
  return FrameSize{nearest_in_steps(wanted.width_px, offer.smallest.width_px,
                                    offer.largest.width_px, offer.step.width_px),
                   nearest_in_steps(wanted.height_px, offer.smallest.height_px,
                                    offer.largest.height_px, offer.step.height_px)};
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
      return std::tuple(distance(choice.size, wanted), luma_cost(choice.format));
    };
    if (!best || rank(next) < rank(*best)) best = next;
  }
  return best;
}

}  // namespace loopd
