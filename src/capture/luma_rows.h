#pragma once

#include <cstddef>
#include <cstdint>

#include "capture/luma.h"

namespace loopd {

// One row of packed pixels to luma: `luma[i]` for i in [0, width). Written so that the compiler
// turns each loop into vector code; rows may begin at any address. `pixels` and `luma` must not
// overlap. All read at most `row_bytes` of their format and no more.

/// YUYV, in which the luma bytes are the even ones.
inline void luma_row_even_bytes(const std::uint8_t* __restrict pixels, std::size_t width,
                                std::uint8_t* __restrict luma) {
  for (std::size_t i = 0; i < width; ++i) luma[i] = pixels[2 * i];
}

/// UYVY, and the high bytes of Y16: the odd ones.
inline void luma_row_odd_bytes(const std::uint8_t* __restrict pixels, std::size_t width,
                               std::uint8_t* __restrict luma) {
  for (std::size_t i = 0; i < width; ++i) luma[i] = pixels[2 * i + 1];
}

/// Y10: bits 2 to 9 of each little-endian word; whatever is above bit 9 is ignored.
inline void luma_row_y10(const std::uint8_t* __restrict pixels, std::size_t width,
                         std::uint8_t* __restrict luma) {
  for (std::size_t i = 0; i < width; ++i)
    luma[i] = static_cast<std::uint8_t>((pixels[2 * i] >> 2) | (pixels[2 * i + 1] << 6));
}

/// Three bytes a pixel; `kRed` is the place of red, 0 or 2.
template <std::size_t kRed>
void luma_row_rgb(const std::uint8_t* __restrict pixels, std::size_t width,
                  std::uint8_t* __restrict luma) {
  for (std::size_t i = 0; i < width; ++i)
    luma[i] = luma_from_rgb(pixels[3 * i + kRed], pixels[3 * i + 1], pixels[3 * i + 2 - kRed]);
}

}  // namespace loopd
