#include "verify/rotation.h"

#include <algorithm>
#include <cmath>

namespace loopd {
namespace {

using Bins = std::array<double, DirectionHistogram::kBins>;
constexpr std::size_t kBins = DirectionHistogram::kBins;
constexpr double kBinRad = 2 * kPi / kBins;
constexpr double kTanPi8 = 0.41421356237309504880;  // tan(pi / 8)

// A rival peak counts when it is farther than 25 degrees (5 bins) from the best: nearer ones are
// the same peak, and would pass the same angle filter.
constexpr std::size_t kPeakBins = 5;
// Correlation of line histograms: the rival must stay below this share of the best, both taken
// above the mean (a uniform histogram correlates everywhere).
constexpr double kMaxRivalCorrelation = 0.7;
// Differences of matched features: the peak's 25 degrees hold 7 % of votes that agree on nothing.
constexpr double kMinPeakShare = 0.25;
constexpr double kMaxRivalShare = 0.5;
constexpr std::size_t kMinPointVotes = 8;

// atan(z) for |z| <= tan(pi / 8) by its Taylor series; the first term left out is below 1e-10.
double atan_small(double z) {
  const double z2 = z * z;
  double sum = 0;
  for (int n = 21; n >= 1; n -= 2) sum = (n % 4 == 1 ? 1.0 : -1.0) / n + z2 * sum;
  return z * sum;
}

// atan(z) for z in [0, 1].
double atan_unit(double z) {
  return z > kTanPi8 ? kPi / 4 + atan_small((z - 1) / (z + 1)) : atan_small(z);
}

Bins smoothed(const Bins& in) {
  Bins out{};
  for (std::size_t i = 0; i < kBins; ++i)
    out[i] = 0.25 * in[(i + kBins - 1) % kBins] + 0.5 * in[i] + 0.25 * in[(i + 1) % kBins];
  return out;
}

std::size_t circular_distance(std::size_t a, std::size_t b) {
  const std::size_t d = a > b ? a - b : b - a;
  return std::min(d, kBins - d);
}

std::size_t highest(const Bins& values) {
  return static_cast<std::size_t>(std::max_element(values.begin(), values.end()) - values.begin());
}

// The highest value farther than kPeakBins from `peak`.
double highest_rival(const Bins& values, std::size_t peak) {
  double rival = 0;
  for (std::size_t i = 0; i < kBins; ++i)
    if (circular_distance(i, peak) > kPeakBins) rival = std::max(rival, values[i]);
  return rival;
}

// Angle of `peak`, moved to the top of the parabola through it and its neighbours.
double peak_angle(const Bins& values, std::size_t peak) {
  const double left = values[(peak + kBins - 1) % kBins], right = values[(peak + 1) % kBins];
  const double bend = left - 2 * values[peak] + right;
  const double shift = bend < 0 ? 0.5 * (left - right) / bend : 0.0;
  return wrap_to_turn((static_cast<double>(peak) + shift) * kBinRad);
}

DirectionHistogram histogram_of(std::span<const Line> lines) {
  DirectionHistogram histogram;
  for (const Line& line : lines) {
    const auto direction = line_direction_rad(line);
    if (!direction) continue;
    const double dx = static_cast<double>(line.end_x_px) - line.start_x_px;
    const double dy = static_cast<double>(line.end_y_px) - line.start_y_px;
    histogram.add(*direction, std::sqrt(dx * dx + dy * dy));
  }
  return histogram;
}

}  // namespace

double deterministic_atan2(double y, double x) {
  const double ax = std::abs(x), ay = std::abs(y);
  if (ax == 0 && ay == 0) return 0;
  double angle = ay <= ax ? atan_unit(ay / ax) : kPi / 2 - atan_unit(ax / ay);
  if (x < 0) angle = kPi - angle;
  return y < 0 ? -angle : angle;
}

double wrap_to_turn(double angle_rad) {
  while (angle_rad < 0) angle_rad += 2 * kPi;
  while (angle_rad >= 2 * kPi) angle_rad -= 2 * kPi;
  return angle_rad;
}

double absolute_angle(double angle_rad) {
  const double turn = wrap_to_turn(angle_rad);
  return turn > kPi ? 2 * kPi - turn : turn;
}

std::optional<double> line_direction_rad(const Line& line) {
  const double dx = static_cast<double>(line.end_x_px) - line.start_x_px;
  const double dy = static_cast<double>(line.end_y_px) - line.start_y_px;
  if (!std::isfinite(dx) || !std::isfinite(dy) || (dx == 0 && dy == 0)) return std::nullopt;
  return wrap_to_turn(deterministic_atan2(dy, dx));
}

void DirectionHistogram::add(double angle_rad, double weight) {
  const double position = angle_rad / kBinRad;
  const double floor = std::floor(position);
  const std::size_t low = static_cast<std::size_t>(floor) % kBins;
  const double share = position - floor;
  bins_[low] += (1 - share) * weight;
  bins_[(low + 1) % kBins] += share * weight;
  total_ += weight;
}

std::optional<double> rotation_from_lines(std::span<const Line> query,
                                          std::span<const Line> candidate) {
  const DirectionHistogram q = histogram_of(query), c = histogram_of(candidate);
  if (!(q.total() > 0) || !(c.total() > 0)) return std::nullopt;
  const Bins qs = smoothed(q.bins()), cs = smoothed(c.bins());
  Bins correlation{};
  for (std::size_t shift = 0; shift < kBins; ++shift)
    for (std::size_t i = 0; i < kBins; ++i) correlation[shift] += qs[i] * cs[(i + shift) % kBins];
  const double mean = q.total() * c.total() / kBins;  // of the correlation over all shifts
  const std::size_t peak = highest(correlation);
  const double rival = highest_rival(correlation, peak);
  if (!(rival - mean <= kMaxRivalCorrelation * (correlation[peak] - mean))) return std::nullopt;
  return peak_angle(correlation, peak);
}

std::optional<double> rotation_from_differences(const DirectionHistogram& differences) {
  if (!(differences.total() > 0)) return std::nullopt;
  const Bins bins = smoothed(differences.bins());
  Bins mass{};  // votes within 12.5 degrees
  for (std::size_t i = 0; i < kBins; ++i)
    for (std::size_t k = 0; k < 5; ++k) mass[i] += bins[(i + kBins + k - 2) % kBins];
  const std::size_t peak = highest(mass);
  if (!(mass[peak] >= kMinPeakShare * differences.total())) return std::nullopt;
  if (!(highest_rival(mass, peak) <= kMaxRivalShare * mass[peak])) return std::nullopt;
  return peak_angle(mass, peak);
}

std::optional<double> rotation_from_points(std::span<const Point> query,
                                           std::span<const Point> candidate,
                                           std::span<const FeatureMatch> matches) {
  if (matches.size() < kMinPointVotes) return std::nullopt;
  DirectionHistogram differences;
  for (const FeatureMatch& m : matches) {
    const double q = query[m.query].angle_deg, c = candidate[m.candidate].angle_deg;
    if (!(q >= 0 && q <= 360 && c >= 0 && c <= 360)) continue;
    differences.add(wrap_to_turn((c - q) * (kPi / 180)), 1 - 0.5 * m.ratio);
  }
  return rotation_from_differences(differences);
}

}  // namespace loopd
