#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "verify/correspondences.h"
#include "verify/homography.h"
#include "verify/linear.h"
#include "verify/ransac.h"
#include "verify/sampling.h"

namespace loopd {

/// A fundamental matrix in normalised coordinates, match^T F query = 0, with the epipole of the
/// match image signed such that cross(epipole, match) . (F query) > 0 for what both cameras see in
/// front of them (oriented epipolar constraint; Chum, Werner, Matas, ICPR 2004).
struct EpipolarModel {
  Mat3 fundamental{};
  Vec3 epipole{};
};

/// Estimator of Ransac: minimal samples of 7, refinement by weighted linear least squares.
struct EpipolarEstimator {
  using Model = EpipolarModel;
  static constexpr std::size_t kSampleSize = 7;
  static constexpr std::size_t kMaxModels = 3;

  /// Models on whose right side all 7 correspondences are; none if the sample is degenerate.
  static std::size_t solve(const Correspondences& c, std::span<const std::uint32_t> sample,
                           std::span<Model, kMaxModels> models);
  /// Squared Sampson distance / squared tolerance; huge on the wrong side of the epipole.
  static void residuals(const Model& model, const Correspondences& c, std::size_t first,
                        std::size_t last, std::span<double> out);
  static bool refine(const Correspondences& c, std::span<const double> weights, Model& model);
};

/// All fundamental matrices (unit Frobenius norm, rank 2) through 7 correspondences of `c`; none if
/// the sample is degenerate. Source: Hartley and Zisserman, section 11.1.2.
std::size_t seven_point(const Correspondences& c, std::span<const std::uint32_t> sample,
                        std::span<Mat3, 3> out);

/// The best epipolar geometry of `c`; none for fewer than 8 correspondences or degenerate ones.
/// With `plane`, a homography of the same correspondences, models of that plane and two
/// correspondences off it (plane and parallax) compete as well: samples from one dominant plane
/// alone do not determine F. Pure but for `random` and `scratch`.
std::optional<Scored<EpipolarModel>> estimate_fundamental(const Correspondences& c,
                                                          const HomographyModel* plane,
                                                          int max_iterations, Random& random,
                                                          RansacScratch& scratch);

/// `fundamental` in raw pixels, Frobenius norm 1.
Mat3 fundamental_in_pixels(const Mat3& fundamental, const Correspondences& c);

}  // namespace loopd
