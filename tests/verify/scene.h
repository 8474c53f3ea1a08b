#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "loopd/features.h"
#include "verify/linear.h"
#include "verify/sampling.h"

namespace loopd::testing {

inline constexpr int kWidth = 640;
inline constexpr int kHeight = 480;
inline constexpr double kFocal = 500;

/// Uniform in [low, high).
inline double uniform(Random& random, double low, double high) {
  return low + (high - low) * static_cast<double>(random.next() >> 11) * 0x1p-53;
}
/// About normal: mean 0, standard deviation `sigma`, bounded by 6 sigma.
double normal(Random& random, double sigma);
Descriptor random_descriptor(Random& random);
/// `original` with `bits` different bits flipped.
Descriptor flipped(const Descriptor& original, int bits, Random& random);
Point point_at(double x, double y);

/// What two cameras see of a made world.
struct SceneOptions {
  int points = 400;
  int lines = 60;
  double outliers = 0;  ///< share of features whose partner is somewhere else
  double noise_px = 0.5;
  int flipped_bits = 20;
  double roll_rad = 0;  ///< of the match camera about its axis
  double pitch_rad = 0.05;
  double yaw_rad = 0.1;
  Vec3 translation{0.6, 0.1, 0.3};  ///< t of X_match = R X_query + t; depths are 4 to 20
  bool planar = false;              ///< all on a slanted wall
  double slide = 0.1;               ///< one end of a line moves along it by up to this share
  std::uint64_t seed = 1;
};

struct Scene {
  Features query, match;
  /// By query feature: index of its partner in the match image, and whether it is the true one.
  std::vector<std::size_t> point_partner, line_partner;
  std::vector<bool> point_true, line_true;
  Mat3 fundamental{};  ///< truth, raw pixels, unit norm; zero without translation
  Mat3 homography{};   ///< truth for planar scenes and pure rotation
  std::size_t true_points() const;
  std::size_t true_lines() const;
};

Scene make_scene(const SceneOptions& options);

/// Features of an image of nothing in particular: random everything.
Features random_features(int points, int lines, std::uint64_t seed);

/// Distance of (x, y) of the match from the epipolar line of (qx, qy), px.
double epipolar_distance(const Mat3& f, double qx, double qy, double x, double y);

}  // namespace loopd::testing
