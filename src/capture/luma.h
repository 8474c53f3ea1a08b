#pragma once

#include <cstdint>

namespace loopd {

/// Luma of an RGB pixel: ITU-R BT.601, full range, Y = 0.299 R + 0.587 G + 0.114 B, in 16-bit fixed
/// point and rounded to nearest, so that it is the same on every CPU. These are also the constants
/// of the JPEG standard's conversion, so a picture gives the same luma as PNG and as JPEG, but for
/// JPEG's own loss.
constexpr std::uint8_t luma_from_rgb(unsigned red, unsigned green, unsigned blue) {
  return static_cast<std::uint8_t>((19595 * red + 38470 * green + 7471 * blue + 32768) >> 16);
}

}  // namespace loopd
