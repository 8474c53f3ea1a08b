#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "loopd/features.h"
#include "verify/matches.h"

namespace loopd {

inline constexpr double kPi = 3.14159265358979323846;

/// Angle of the vector (x, y), (-pi, pi], 0 for the zero vector; within 1e-9 rad of std::atan2 but
/// with + - * / only, so that every CPU computes the same bits. Reentrant.
double deterministic_atan2(double y, double x);

/// `angle_rad` brought to [0, 2 pi). Precondition: finite and within a few turns.
double wrap_to_turn(double angle_rad);

/// |angle| on the circle, [0, pi]. Precondition: finite and within a few turns.
double absolute_angle(double angle_rad);

/// Direction of a line from start to end, [0, 2 pi), clockwise on the screen (x towards y);
/// none if it has no length or is not finite.
std::optional<double> line_direction_rad(const Line& line);

/// Histogram over the full turn; votes are shared by the two nearest bins.
class DirectionHistogram {
 public:
  static constexpr std::size_t kBins = 72;  ///< of 5 degrees

  /// Precondition: angle_rad in [0, 2 pi], weight finite and >= 0.
  void add(double angle_rad, double weight);
  double total() const { return total_; }
  const std::array<double, kBins>& bins() const { return bins_; }

 private:
  std::array<double, kBins> bins_{};
  double total_ = 0;
};

// Three ways to see the global rotation theta_g that turns directions of the query into those of
// the candidate (theta_c = theta_t + theta_g; the sign of Eq. 5), [0, 2 pi). Each says nothing
// where a second rotation explains the images nearly as well. Pure, reentrant.

/// From length-weighted histograms of all directed lines, no matches needed (the way of the LBD
/// paper, Zhang and Koch 2013): the shift at which the two histograms correlate best.
std::optional<double> rotation_from_lines(std::span<const Line> query,
                                          std::span<const Line> candidate);

/// From a histogram of differences of directions of matched features: its dominant peak.
std::optional<double> rotation_from_differences(const DirectionHistogram& differences);

/// rotation_from_differences() of the orientations of matched points; none for fewer than 8.
std::optional<double> rotation_from_points(std::span<const Point> query,
                                           std::span<const Point> candidate,
                                           std::span<const FeatureMatch> matches);

}  // namespace loopd
