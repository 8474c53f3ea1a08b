#pragma once

#include <span>

#include "features/gradient_image.h"
#include "loopd/features.h"

namespace loopd {

/// Binary Line Band Descriptor (Zhang and Koch 2013; its 256-bit form as in the paper, section
/// 2.1.2): 9 bands of 7 px along the line; mean and deviation of the gradient's four half-sums in
/// each band and its neighbours; 32 pairs of bands compared value by value, 8 bits a pair.
/// Only differences decide a bit, so the float form's normalisation is not needed.
/// Lines are sampled at most every 1.5 px along and every pixel across, up to 48 times; sums are
/// integers. Line coordinates are pixels of the gradient image; any finite ones are answered
/// (samples beyond the image are those of its border).
void describe_lines(const GradientImage& gradient, std::span<const Line> lines,
                    std::span<Descriptor> descriptors);

/// The same bit for bit without instructions of a certain CPU.
void describe_lines_plainly(const GradientImage& gradient, std::span<const Line> lines,
                            std::span<Descriptor> descriptors);

}  // namespace loopd
