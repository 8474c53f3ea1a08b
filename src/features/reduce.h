#pragma once

#include <cstdint>
#include <vector>

#include "loopd/frame.h"

namespace loopd {

/// The whole factor by which an image must shrink to hold at most `max_pixels`; 1 = not at all.
int reduction_factor(int width_px, int height_px, int max_pixels);

/// `image` shrunk by averaging factor x factor blocks (rounded); a remainder at the right and the
/// bottom is dropped. `storage` keeps the pixels and is reused. A factor of 1 returns `image`.
LumaView reduce_image(const LumaView& image, int factor, std::vector<std::uint8_t>& storage);

}  // namespace loopd
