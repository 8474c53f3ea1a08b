#pragma once

#include <cstdint>
#include <vector>

#include "make_sequence/renderer.h"

namespace loopd::sequence {

struct SensorOptions {
  double noise = 2;   ///< standard deviation, grey levels
  double blur = 0.6;  ///< standard deviation, pixels; 0 = none
};

/// Turns radiance into an 8-bit image of `width` x `height`: blur, gain, noise of `noise_seed`,
/// rounding. Changes `radiance`. Same inputs, same bytes. Reentrant.
void expose(Radiance& radiance, int width, int height, double gain, const SensorOptions& options,
            std::uint64_t noise_seed, std::vector<std::uint8_t>& out);

}  // namespace loopd::sequence
