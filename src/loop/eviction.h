#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "loop/map.h"

namespace loopd {

/// What the map loses with the searchable image at `position`: how much of the path would be
/// covered by nobody else, less if an older image shows the same place, more if it has proved
/// itself by loops, less the older it is without any. No unit; only the order matters.
double worth(std::span<const MapImage> searchable, std::size_t position);

/// Position of the image worth least, the oldest of equals. Never the first (the path begins
/// there) nor the newest. None if there is no other. Cost: one pass.
std::optional<std::size_t> least_worth(std::span<const MapImage> searchable);

}  // namespace loopd
