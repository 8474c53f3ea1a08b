#include "verify/pure_rotation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace loopd {
namespace {

// Focal lengths tried, of the longer image side: fields of view from 110 to 45 degrees.
constexpr double kMinFocal = 0.35;
constexpr double kMaxFocal = 1.2;
constexpr double kFocalStep = 1.08;
constexpr int kFocalHalvings = 5;
constexpr int kPolarSteps = 12;
constexpr double kMinInliers = 20;

// Mean squared errors, of that of the free homography: a rotation must be nearly as good (it has 4
// parameters fewer, and is the nearest one, not the best), a similarity clearly worse. In the
// synthetic scenes of the tests true rotations stay below 1.2 and walls above 10.
constexpr double kAsGood = 1.5;
constexpr double kSpentParameters = 16;
constexpr double kClearlyWorse = 2.0;

using Transfer = Mat3;

// Mean squared forward transfer error of the inliers, in units of their tolerance.
double mean_error(const Transfer& h, const Correspondences& c, std::span<const double> residuals) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < c.size(); ++i) {
    if (residuals[i] > 1) continue;
    const Vec3 p = multiply(h, Vec3{c.query_x[i], c.query_y[i], 1});
    const double dx = p[0] / p[2] - c.match_x[i], dy = p[1] / p[2] - c.match_y[i];
    sum += (dx * dx + dy * dy) * c.inverse_tolerance_sq[i];
    count += 1;
  }
  return sum / count;
}

double inlier_count(std::span<const double> residuals) {
  double count = 0;
  for (const double r : residuals) count += r <= 1;
  return count;
}

// The least-squares similarity match = [a -b; b a] query + t of the inliers.
Transfer similarity(const Correspondences& c, std::span<const double> residuals) {
  double n = 0, qx = 0, qy = 0, mx = 0, my = 0;
  for (std::size_t i = 0; i < c.size(); ++i) {
    if (residuals[i] > 1) continue;
    n += 1, qx += c.query_x[i], qy += c.query_y[i], mx += c.match_x[i], my += c.match_y[i];
  }
  qx /= n, qy /= n, mx /= n, my /= n;
  double along = 0, across = 0, norm = 0;
  for (std::size_t i = 0; i < c.size(); ++i) {
    if (residuals[i] > 1) continue;
    const double ux = c.query_x[i] - qx, uy = c.query_y[i] - qy;
    const double vx = c.match_x[i] - mx, vy = c.match_y[i] - my;
    along += ux * vx + uy * vy;
    across += ux * vy - uy * vx;
    norm += ux * ux + uy * uy;
  }
  const double a = along / norm, b = across / norm;
  return {a, -b, mx - a * qx + b * qy, b, a, my - b * qx - a * qy, 0, 0, 1};
}

// K^-1 H K for a camera of this focal length, scaled to determinant-like size 1.
Mat3 without_camera(const Mat3& pixels_h, const Mat3& k, const Mat3& k_inverse) {
  Mat3 m = unit_norm(multiply(k_inverse, multiply(pixels_h, k)));
  for (double& x : m) x *= std::sqrt(3.0);
  return m;
}

// The nearest rotation, by Newton's iteration of the polar decomposition.
Mat3 nearest_rotation(Mat3 m) {
  for (int step = 0; step < kPolarSteps; ++step) {
    const Mat3 inverse_transposed = transpose(adjugate(m));
    const double det = determinant(m);
    for (std::size_t i = 0; i < 9; ++i) m[i] = 0.5 * (m[i] + inverse_transposed[i] / det);
  }
  return m;
}

struct Camera {
  Mat3 k, k_inverse;
};

Camera camera_of(const Features& image, double focal_px) {
  const double cx = 0.5 * (image.width_px - 1), cy = 0.5 * (image.height_px - 1);
  return {denormalisation({cx, cy}, focal_px), normalisation({cx, cy}, focal_px)};
}

// The rotation nearest to the homography `pixels_h` for this focal length, as a transfer in
// normalised coordinates.
Transfer rotation_for(const Mat3& pixels_h, const Correspondences& c, const Features& image,
                      double focal_px) {
  const Camera camera = camera_of(image, focal_px);
  const Mat3 rotation = nearest_rotation(without_camera(pixels_h, camera.k, camera.k_inverse));
  const Mat3 in_pixels = multiply(camera.k, multiply(rotation, camera.k_inverse));
  return multiply(normalisation(c.match_centre_px, c.scale_px),
                  multiply(in_pixels, denormalisation(c.query_centre_px, c.scale_px)));
}

// The least error of a rotation over all focal lengths: on a grid, then between its best
// neighbours in ever smaller steps.
double best_rotation_error(const HomographyModel& model, const Correspondences& c,
                           std::span<const double> residuals, const Features& image) {
  const Mat3 pixels_h = homography_in_pixels(model.forward, c);
  const double side = std::max(image.width_px, image.height_px);
  const auto error_at = [&](double focal) {
    return mean_error(rotation_for(pixels_h, c, image, focal * side), c, residuals);
  };
  double best = kMinFocal, least = error_at(kMinFocal);
  const auto try_focal = [&](double focal) {
    const double error = focal >= kMinFocal && focal <= kMaxFocal ? error_at(focal) : least;
    if (!(error < least)) return;
    least = error;
    best = focal;
  };
  for (double focal = kMinFocal; focal <= kMaxFocal; focal *= kFocalStep) try_focal(focal);
  double step = best * (kFocalStep - 1) / 2;
  for (int halving = 0; halving < kFocalHalvings; ++halving, step /= 2) {
    const double middle = best;
    try_focal(middle - step);
    try_focal(middle + step);
  }
  return least;
}

}  // namespace

bool is_pure_rotation(const HomographyModel& model, const Correspondences& c,
                      std::span<const double> residuals, const Features& query,
                      const Features& candidate) {
  if (query.width_px != candidate.width_px || query.height_px != candidate.height_px) return false;
  if (query.width_px < 1 || query.height_px < 1) return false;
  const double inliers = inlier_count(residuals);
  if (inliers < kMinInliers) return false;
  const double free_error = mean_error(model.forward, c, residuals);
  const double rotation_error = best_rotation_error(model, c, residuals, query);
  const double similarity_error = mean_error(similarity(c, residuals), c, residuals);
  // Exact data has no error to compare with: a thousandth of the tolerance counts as none.
  const double floor = 1e-6;
  return rotation_error <= free_error * (kAsGood + kSpentParameters / inliers) + floor &&
         similarity_error > free_error * kClearlyWorse + 10 * floor;
}

}  // namespace loopd
