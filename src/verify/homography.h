#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "verify/correspondences.h"
#include "verify/linear.h"
#include "verify/ransac.h"
#include "verify/sampling.h"

namespace loopd {

/// A homography in normalised coordinates, match ~ forward query, query ~ backward match. Both are
/// scaled such that what both cameras see has a positive third coordinate.
struct HomographyModel {
  Mat3 forward{};
  Mat3 backward{};
};

/// `forward` with its inverse; none if it is singular, or a mirror image (no camera sees a plane
/// from both sides).
std::optional<HomographyModel> make_homography(const Mat3& forward);

/// Estimator of Ransac: minimal samples of 4, refinement by weighted linear least squares.
struct HomographyEstimator {
  using Model = HomographyModel;
  static constexpr std::size_t kSampleSize = 4;
  static constexpr std::size_t kMaxModels = 1;

  /// None if the sample is degenerate or not seen from one side of the plane.
  static std::size_t solve(const Correspondences& c, std::span<const std::uint32_t> sample,
                           std::span<Model, kMaxModels> models);
  /// Symmetric transfer error, scaled such that image noise which passes the epipolar test (one
  /// degree of freedom) with 99 % passes this one (two degrees) with 99 % as well.
  static void residuals(const Model& model, const Correspondences& c, std::size_t first,
                        std::size_t last, std::span<double> out);
  static bool refine(const Correspondences& c, std::span<const double> weights, Model& model);
};

/// The best homography of `c`; none for fewer than 4 correspondences or degenerate ones.
std::optional<Scored<HomographyModel>> estimate_homography(const Correspondences& c,
                                                           int max_iterations, Random& random,
                                                           RansacScratch& scratch);

/// `forward` in raw pixels, Frobenius norm 1.
Mat3 homography_in_pixels(const Mat3& forward, const Correspondences& c);

}  // namespace loopd
