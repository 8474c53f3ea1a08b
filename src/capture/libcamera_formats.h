#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/capture_device.h"

namespace loopd {

/// Four characters as the number that the kernel's DRM and V4L2 codes are.
constexpr std::uint32_t fourcc(char a, char b, char c, char d) {
  return static_cast<std::uint32_t>(static_cast<unsigned char>(a)) |
         static_cast<std::uint32_t>(static_cast<unsigned char>(b)) << 8 |
         static_cast<std::uint32_t>(static_cast<unsigned char>(c)) << 16 |
         static_cast<std::uint32_t>(static_cast<unsigned char>(d)) << 24;
}

/// How we read a frame of the DRM format that libcamera names by `code`; none if we cannot, as with
/// every `modifier` but 0 (linear). DRM names packed RGB from the high byte down, V4L2 from the
/// first byte up: DRM's RGB888 is our BGR24. Planar formats whose first plane is luma count as NV12
/// or YU12, whatever their chroma.
std::optional<PixelFormat> pixel_format_from_drm(std::uint32_t code, std::uint64_t modifier);

struct FrameSize {
  int width_px = 0;
  int height_px = 0;
  bool operator==(const FrameSize&) const = default;
};

/// One pixel format of a stream and the sizes it comes in.
struct FormatOffer {
  std::uint32_t code = 0;  ///< DRM's
  std::uint64_t modifier = 0;
  std::vector<FrameSize> sizes{};
  /// A range of sizes besides: every multiple of `step` from `smallest` to `largest`. None if
  /// step.width_px or step.height_px is 0.
  FrameSize smallest{};
  FrameSize largest{};
  FrameSize step{};
};

struct FormatChoice {
  std::size_t offer = 0;  ///< index
  PixelFormat format = PixelFormat::kGrey;
  FrameSize size{};
};

/// The offer whose size is nearest to `wanted` (a size it has exactly comes first); of several the
/// one that costs least to turn into luma; then the first. With `only` no other format counts. None
/// if none can be read. Without any size an offer stands for `wanted`. Reentrant.
std::optional<FormatChoice> choose_format(std::span<const FormatOffer> offers,
                                          std::optional<PixelFormat> only, FrameSize wanted);

}  // namespace loopd
