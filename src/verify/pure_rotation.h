#pragma once

#include <span>

#include "loopd/features.h"
#include "verify/correspondences.h"
#include "verify/homography.h"

namespace loopd {

/// Whether the inliers of `model` (residual <= 1) show that the camera only turned.
///
/// Intrinsics are not known: the principal point is taken to be the image's centre and the focal
/// length one of a range (fields of view of 45 to 110 degrees), the same in both images. True
/// only if a rotation with one of these focal lengths explains the inliers as well as the free
/// homography does, and a similarity (shift, roll, zoom) clearly does not: a small turn and a
/// camera moving along a wall would look the same. Misses pure rotations that are small, that are
/// about the optical axis only, or seen through a lens with strong distortion. Pure, reentrant.
bool is_pure_rotation(const HomographyModel& model, const Correspondences& c,
                      std::span<const double> residuals, const Features& query,
                      const Features& candidate);

}  // namespace loopd
