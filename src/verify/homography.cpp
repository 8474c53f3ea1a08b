#include "verify/homography.h"

#include <array>
#include <cmath>

namespace loopd {
namespace {

constexpr double kHuge = 1e12;
constexpr double kSmallestDeterminant = 1e-9;  // of a matrix of unit norm
constexpr std::size_t kMinRefined = 4;

// The squared transfer errors of both images add up to 4 sigma^2 chi2(2), the squared Sampson
// distance is sigma^2 chi2(1); their 99 % quantiles are 9.21 and 6.63.
constexpr double kTransferScale = 1 / (4 * 9.21 / 6.63);

// The two rows of match x (H query) = 0 with the third coordinate of match = 1.
std::array<Vec9, 2> transfer_rows(double qx, double qy, double mx, double my) {
  return {Vec9{qx, qy, 1, 0, 0, 0, -mx * qx, -mx * qy, -mx},
          Vec9{0, 0, 0, qx, qy, 1, -my * qx, -my * qy, -my}};
}

double depth_at(const Mat3& h, double x, double y) { return h[6] * x + h[7] * y + h[8]; }

}  // namespace

std::optional<HomographyModel> make_homography(const Mat3& forward) {
  const Mat3 h = unit_norm(forward);
  if (!(determinant(h) > kSmallestDeterminant)) return std::nullopt;
  return HomographyModel{h, adjugate(h)};
}

std::size_t HomographyEstimator::solve(const Correspondences& c,
                                       std::span<const std::uint32_t> sample,
                                       std::span<Model, kMaxModels> models) {
  std::array<double, 72> rows{};
  for (std::size_t s = 0; s < kSampleSize; ++s) {
    const std::size_t i = sample[s];
    const auto pair = transfer_rows(c.query_x[i], c.query_y[i], c.match_x[i], c.match_y[i]);
    for (std::size_t r = 0; r < 2; ++r)
      for (std::size_t k = 0; k < 9; ++k) rows[(2 * s + r) * 9 + k] = pair[r][k];
  }
  const auto basis = null_space<8>(rows);
  if (!basis) return 0;
  Mat3 h = (*basis)[0];
  std::size_t positive = 0;
  for (const std::uint32_t i : sample) positive += depth_at(h, c.query_x[i], c.query_y[i]) > 0;
  if (positive != 0 && positive != sample.size()) return 0;
  if (positive == 0)
    for (double& x : h) x = -x;
  const auto model = make_homography(h);
  if (!model) return 0;
  models[0] = *model;
  return 1;
}

void HomographyEstimator::residuals(const Model& model, const Correspondences& c, std::size_t first,
                                    std::size_t last, std::span<double> out) {
  const Mat3 f = model.forward, b = model.backward;
  const double *const qx = c.query_x.data() + first, *const qy = c.query_y.data() + first;
  const double *const mx = c.match_x.data() + first, *const my = c.match_y.data() + first;
  const double* const inverse_tolerance_sq = c.inverse_tolerance_sq.data() + first;
  double* const to = out.data();
  for (std::size_t i = 0; i < last - first; ++i) {
    const double fw = f[6] * qx[i] + f[7] * qy[i] + f[8];
    const double bw = b[6] * mx[i] + b[7] * my[i] + b[8];
    const double fx = (f[0] * qx[i] + f[1] * qy[i] + f[2]) / fw - mx[i];
    const double fy = (f[3] * qx[i] + f[4] * qy[i] + f[5]) / fw - my[i];
    const double bx = (b[0] * mx[i] + b[1] * my[i] + b[2]) / bw - qx[i];
    const double by = (b[3] * mx[i] + b[4] * my[i] + b[5]) / bw - qy[i];
    const double r =
        (fx * fx + fy * fy + bx * bx + by * by) * (inverse_tolerance_sq[i] * kTransferScale);
    const double bounded = r < kHuge ? r : kHuge;  // NaN as well
    to[i] = fw > 0 ? bounded : kHuge;
  }
}

bool HomographyEstimator::refine(const Correspondences& c, std::span<const double> weights,
                                 Model& model) {
  std::array<double, 81> normal{};
  std::size_t used = 0;
  for (std::size_t i = 0; i < c.size(); ++i) {
    if (!(weights[i] > 0)) continue;
    // Dividing by the depth makes the algebraic error the transfer error of the last model.
    const double depth = depth_at(model.forward, c.query_x[i], c.query_y[i]);
    if (!(depth > 1e-9)) continue;
    const double weight = weights[i] * c.inverse_tolerance_sq[i] / (depth * depth);
    for (const Vec9& row : transfer_rows(c.query_x[i], c.query_y[i], c.match_x[i], c.match_y[i]))
      for (std::size_t r = 0; r < 9; ++r) {
        const double weighted = weight * row[r];
        for (std::size_t k = r; k < 9; ++k) normal[r * 9 + k] += weighted * row[k];
      }
    ++used;
  }
  if (used < kMinRefined) return false;
  for (std::size_t r = 0; r < 9; ++r)
    for (std::size_t k = 0; k < r; ++k) normal[r * 9 + k] = normal[k * 9 + r];
  Mat3 h = smallest_eigenvector<9>(normal);
  double balance = 0;
  for (std::size_t i = 0; i < c.size(); ++i)
    if (weights[i] > 0) balance += depth_at(h, c.query_x[i], c.query_y[i]) > 0 ? 1 : -1;
  if (balance < 0)
    for (double& x : h) x = -x;
  const auto refined = make_homography(h);
  if (!refined || !all_finite(refined->backward)) return false;
  model = *refined;
  return true;
}

std::optional<Scored<HomographyModel>> estimate_homography(const Correspondences& c,
                                                           int max_iterations, Random& random,
                                                           RansacScratch& scratch) {
  if (c.size() < HomographyEstimator::kSampleSize || !(c.scale_px > 0)) return std::nullopt;
  return Ransac<HomographyEstimator>(c, scratch).run(max_iterations, random);
}

Mat3 homography_in_pixels(const Mat3& forward, const Correspondences& c) {
  const Mat3 query = normalisation(c.query_centre_px, c.scale_px);
  const Mat3 match = denormalisation(c.match_centre_px, c.scale_px);
  return unit_norm(multiply(match, multiply(forward, query)));
}

}  // namespace loopd
