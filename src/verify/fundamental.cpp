#include "verify/fundamental.h"

#include <cmath>

namespace loopd {
namespace {

constexpr std::size_t kMinCorrespondences = 8;
constexpr double kWrongSide = 1e12;
constexpr int kParallaxSamples = 40;

Vec3 query_of(const Correspondences& c, std::size_t i) { return {c.query_x[i], c.query_y[i], 1}; }
Vec3 match_of(const Correspondences& c, std::size_t i) { return {c.match_x[i], c.match_y[i], 1}; }

// One row of the linear system match^T F query = 0, F row-major.
Vec9 epipolar_row(const Vec3& query, const Vec3& match) {
  Vec9 row;
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t k = 0; k < 3; ++k) row[r * 3 + k] = match[r] * query[k];
  return row;
}

double side_of(const EpipolarModel& model, const Vec3& query, const Vec3& match) {
  return dot(cross(model.epipole, match), multiply(model.fundamental, query));
}

// The epipole in the match image: epipole^T F = 0.
std::optional<EpipolarModel> with_epipole(const Mat3& f) {
  const auto epipole = null_vector(transpose(f));
  if (!epipole) return std::nullopt;
  return EpipolarModel{f, *epipole};
}

void flip_epipole(EpipolarModel& model) {
  for (double& x : model.epipole) x = -x;
}

// The nearest matrix of rank 2 (Frobenius), unit norm.
Mat3 rank_two(const Mat3& f) {
  const Vec3 v = smallest_eigenvector<3>(multiply(transpose(f), f));
  const Vec3 fv = multiply(f, v);
  Mat3 out = f;
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t k = 0; k < 3; ++k) out[r * 3 + k] -= fv[r] * v[k];
  return unit_norm(out);
}

// Gives the epipole the sign that most of the weight agrees with.
void orient(const Correspondences& c, std::span<const double> weights, EpipolarModel& model) {
  double balance = 0;
  for (std::size_t i = 0; i < c.size(); ++i) {
    if (weights[i] <= 0) continue;
    balance += side_of(model, query_of(c, i), match_of(c, i)) > 0 ? weights[i] : -weights[i];
  }
  if (balance < 0) flip_epipole(model);
}

// Squared norm of the gradient of match^T F query: the denominator of the Sampson distance.
double sampson_gradient_sq(const Mat3& f, const Vec3& query, const Vec3& match) {
  const Vec3 line = multiply(f, query), back = multiply(transpose(f), match);
  return line[0] * line[0] + line[1] * line[1] + back[0] * back[0] + back[1] * back[1];
}

// F from a plane's homography and two correspondences off it: both parallax lines (H q x m) pass
// through the epipole, and F = [e]x H (Hartley and Zisserman, section 13.3).
std::optional<EpipolarModel> plane_and_parallax(const Correspondences& c, const Mat3& homography,
                                                std::size_t i, std::size_t j) {
  const auto parallax_line = [&](std::size_t k) {
    return cross(multiply(homography, query_of(c, k)), match_of(c, k));
  };
  const Vec3 e = cross(parallax_line(i), parallax_line(j));
  const double norm = std::sqrt(dot(e, e));
  if (!(norm > 1e-12) || !std::isfinite(norm)) return std::nullopt;
  const Vec3 epipole{e[0] / norm, e[1] / norm, e[2] / norm};
  const Mat3 f = unit_norm(multiply(cross_matrix(epipole), homography));
  if (!all_finite(f) || f == Mat3{}) return std::nullopt;
  return EpipolarModel{f, epipole};
}

void propose_plane_and_parallax(const Correspondences& c, const HomographyModel& plane,
                                Random& random, RansacScratch& scratch,
                                Ransac<EpipolarEstimator>& ransac) {
  HomographyEstimator::residuals(plane, c, 0, c.size(), scratch.residuals);
  scratch.off_plane.clear();
  for (std::size_t i = 0; i < c.size(); ++i)
    if (scratch.residuals[i] > 1) scratch.off_plane.push_back(i);
  if (scratch.off_plane.size() < 2)  // nothing off the plane: any epipole will do
    for (std::size_t i = 0; i < c.size(); ++i) scratch.off_plane.push_back(i);
  for (int n = 0; n < kParallaxSamples; ++n) {
    const std::size_t i = scratch.off_plane[random.below(scratch.off_plane.size())];
    const std::size_t j = scratch.off_plane[random.below(scratch.off_plane.size())];
    if (i == j) continue;
    if (const auto model = plane_and_parallax(c, plane.forward, i, j)) ransac.propose(*model);
  }
}

}  // namespace

std::size_t seven_point(const Correspondences& c, std::span<const std::uint32_t> sample,
                        std::span<Mat3, 3> out) {
  std::array<double, 63> rows{};
  for (std::size_t r = 0; r < 7; ++r) {
    const Vec9 row = epipolar_row(query_of(c, sample[r]), match_of(c, sample[r]));
    for (std::size_t k = 0; k < 9; ++k) rows[r * 9 + k] = row[k];
  }
  const auto basis = null_space<7>(rows);
  if (!basis) return 0;
  const Mat3 &a = (*basis)[0], &b = (*basis)[1];
  // det(a + x b) = 0, a cubic in x.
  const Mat3 adj_a = adjugate(a), adj_b = adjugate(b);
  const auto trace_of_product = [](const Mat3& p, const Mat3& q) {
    double sum = 0;
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t k = 0; k < 3; ++k) sum += p[r * 3 + k] * q[k * 3 + r];
    return sum;
  };
  const RealRoots roots = cubic_roots(
      {determinant(a), trace_of_product(adj_a, b), trace_of_product(adj_b, a), determinant(b)});
  std::size_t count = 0;
  for (std::size_t i = 0; i < roots.count; ++i) {
    Mat3 f;
    for (std::size_t k = 0; k < 9; ++k) f[k] = a[k] + roots.value[i] * b[k];
    f = unit_norm(f);
    if (f != Mat3{}) out[count++] = f;
  }
  return count;
}

std::size_t EpipolarEstimator::solve(const Correspondences& c,
                                     std::span<const std::uint32_t> sample,
                                     std::span<Model, kMaxModels> models) {
  std::array<Mat3, 3> matrices{};
  const std::size_t found = seven_point(c, sample, matrices);
  std::size_t count = 0;
  for (std::size_t m = 0; m < found; ++m) {
    auto model = with_epipole(matrices[m]);
    if (!model) continue;
    std::size_t positive = 0;
    for (const std::uint32_t i : sample)
      positive += side_of(*model, query_of(c, i), match_of(c, i)) > 0;
    if (positive != 0 && positive != sample.size()) continue;
    if (positive == 0) flip_epipole(*model);
    models[count++] = *model;
  }
  return count;
}

void EpipolarEstimator::residuals(const Model& model, const Correspondences& c, std::size_t first,
                                  std::size_t last, std::span<double> out) {
  const Mat3 f = model.fundamental;
  const Vec3 e = model.epipole;
  const double *const qx = c.query_x.data() + first, *const qy = c.query_y.data() + first;
  const double *const mx = c.match_x.data() + first, *const my = c.match_y.data() + first;
  const double* const inverse_tolerance_sq = c.inverse_tolerance_sq.data() + first;
  double* const to = out.data();
  for (std::size_t i = 0; i < last - first; ++i) {
    const double a = f[0] * qx[i] + f[1] * qy[i] + f[2];
    const double b = f[3] * qx[i] + f[4] * qy[i] + f[5];
    const double w = f[6] * qx[i] + f[7] * qy[i] + f[8];
    const double back_a = f[0] * mx[i] + f[3] * my[i] + f[6];
    const double back_b = f[1] * mx[i] + f[4] * my[i] + f[7];
    const double error = a * mx[i] + b * my[i] + w;
    const double gradient_sq = a * a + b * b + back_a * back_a + back_b * back_b;
    const double side =
        (e[1] - e[2] * my[i]) * a + (e[2] * mx[i] - e[0]) * b + (e[0] * my[i] - e[1] * mx[i]) * w;
    const double r = error * error * inverse_tolerance_sq[i] / gradient_sq;
    const double bounded = r < kWrongSide ? r : kWrongSide;  // NaN as well
    to[i] = side > 0 ? bounded : kWrongSide;
  }
}

bool EpipolarEstimator::refine(const Correspondences& c, std::span<const double> weights,
                               Model& model) {
  std::array<double, 81> normal{};
  std::size_t used = 0;
  for (std::size_t i = 0; i < c.size(); ++i) {
    if (!(weights[i] > 0)) continue;
    const Vec3 q = query_of(c, i), m = match_of(c, i);
    // Dividing by the gradient makes the algebraic error the Sampson distance of the last model.
    const double gradient_sq = sampson_gradient_sq(model.fundamental, q, m);
    if (!(gradient_sq > 1e-20)) continue;
    const Vec9 row = epipolar_row(q, m);
    const double weight = weights[i] * c.inverse_tolerance_sq[i] / gradient_sq;
    for (std::size_t r = 0; r < 9; ++r) {
      const double weighted = weight * row[r];
      for (std::size_t k = r; k < 9; ++k) normal[r * 9 + k] += weighted * row[k];
    }
    ++used;
  }
  if (used < kMinCorrespondences) return false;
  for (std::size_t r = 0; r < 9; ++r)
    for (std::size_t k = 0; k < r; ++k) normal[r * 9 + k] = normal[k * 9 + r];
  const Mat3 f = rank_two(smallest_eigenvector<9>(normal));
  auto refined = with_epipole(f);
  if (!refined || !all_finite(f)) return false;
  orient(c, weights, *refined);
  model = *refined;
  return true;
}

std::optional<Scored<EpipolarModel>> estimate_fundamental(const Correspondences& c,
                                                          const HomographyModel* plane,
                                                          int max_iterations, Random& random,
                                                          RansacScratch& scratch) {
  if (c.size() < kMinCorrespondences || !(c.scale_px > 0)) return std::nullopt;
  Ransac<EpipolarEstimator> ransac(c, scratch);
  if (plane != nullptr) propose_plane_and_parallax(c, *plane, random, scratch, ransac);
  return ransac.run(max_iterations, random);
}

Mat3 fundamental_in_pixels(const Mat3& fundamental, const Correspondences& c) {
  const Mat3 query = normalisation(c.query_centre_px, c.scale_px);
  const Mat3 match = normalisation(c.match_centre_px, c.scale_px);
  return unit_norm(multiply(transpose(match), multiply(fundamental, query)));
}

}  // namespace loopd
