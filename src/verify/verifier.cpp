#include "verify/verifier.h"

#include <algorithm>
#include <array>
#include <bitset>
#include <cassert>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "verify/correspondences.h"
#include "verify/fundamental.h"
#include "verify/homography.h"
#include "verify/line_matching.h"
#include "verify/point_matching.h"
#include "verify/pure_rotation.h"
#include "verify/ransac.h"
#include "verify/rotation.h"
#include "verify/sampling.h"

namespace loopd {
namespace {

// Any 7 correspondences have an F and any 4 a homography: fewer than these prove nothing.
constexpr std::size_t kMinEpipolarInliers = 8;
constexpr std::size_t kMinHomographyInliers = 6;

// Every pair that fits a homography fits an F as well, and so do a few outliers, because F binds
// only one of two coordinates. Of 50 synthetic walls with up to 70 % outliers all reach this share
// of F's inliers; of 50 scenes with relief none has more than 0.43.
constexpr double kHomographyShare = 0.85;

// A plane worth finding holds 40 % of the matches or more; a sample of 4 then hits it with 2.6 %,
// and a quarter of F's iterations (for samples of 7) miss it once in 700 times.
constexpr int kHomographyIterationShare = 4;

constexpr int kCellColumns = 8;
constexpr int kCellRows = 6;

int cell_of(double x, int width_px, int cells) {
  return static_cast<int>(std::clamp(std::floor((x + 0.5) * cells / width_px), 0.0, cells - 1.0));
}

constexpr int kDistinctCells = 48;
constexpr int kMaxPerCell = 4;  // inliers of one cell that count for spread_inliers

// Where in the query image the inliers are: Verification::cells and ::spread_inliers.
void measure_spread(const InlierPairs& pairs, const Features& query, Verification& out) {
  if (query.width_px < 1 || query.height_px < 1) return;
  std::array<int, kCellColumns * kCellRows> held{};
  for (const InlierPair& p : pairs)
    ++held[static_cast<std::size_t>(cell_of(p.query_y_px, query.height_px, kCellRows) *
                                        kCellColumns +
                                    cell_of(p.query_x_px, query.width_px, kCellColumns))];
  for (const int count : held) {
    out.cells += count > 0 ? 1 : 0;
    out.spread_inliers += std::min(count, kMaxPerCell);
  }
}

// Points among the inliers whose places are new in both images; see Verification::point_inliers.
int count_distinct_points(const InlierPairs& pairs, const Features& query,
                          const Features& candidate) {
  if (std::min(query.width_px, query.height_px) < 1) return 0;
  if (std::min(candidate.width_px, candidate.height_px) < 1) return 0;
  std::bitset<kDistinctCells * kDistinctCells> in_query, in_candidate;
  const auto place = [](float x, float y, const Features& image) {
    return static_cast<std::size_t>(cell_of(y, image.height_px, kDistinctCells) * kDistinctCells +
                                    cell_of(x, image.width_px, kDistinctCells));
  };
  int distinct = 0;
  for (const InlierPair& p : pairs) {
    if (p.is_line) continue;
    const std::size_t q = place(p.query_x_px, p.query_y_px, query);
    const std::size_t c = place(p.match_x_px, p.match_y_px, candidate);
    distinct += !in_query[q] && !in_candidate[c] ? 1 : 0;
    in_query.set(q);
    in_candidate.set(c);
  }
  return distinct;
}

// Features that all differ, all over the image.
Features scattered_features(std::size_t points, std::size_t lines) {
  Random random(1);
  const auto place = [&] { return static_cast<float>(random.below(4096)); };
  const auto descriptor = [&] {
    Descriptor made;
    for (auto& word : made.words) word = random.next();
    return made;
  };
  Features features;
  features.width_px = features.height_px = 4096;
  for (std::size_t i = 0; i < points; ++i) {
    features.points.push_back({place(), place(), 31, 0});
    features.point_descriptors.push_back(descriptor());
  }
  for (std::size_t i = 0; i < lines; ++i) {
    const float x = place(), y = place();
    features.lines.push_back({x, y, x + 100, y + 10});
    features.line_descriptors.push_back(descriptor());
  }
  return features;
}

// Points of one scene turn together from one image to the other.
constexpr double kMostTurnApart = 30 * (kPi / 180);

bool turns_with(const Point& query, const Point& candidate, double rotation_rad) {
  const auto known = [](float angle_deg) { return angle_deg >= 0 && angle_deg <= 360; };
  if (!known(query.angle_deg) || !known(candidate.angle_deg)) return false;
  const double turn = (candidate.angle_deg - query.angle_deg) * (kPi / 180);
  return absolute_angle(turn - rotation_rad) <= kMostTurnApart;
}

double promise_of(const Features& query, const Features& candidate, const ImageMatches& matches) {
  if (query.width_px < 1 || query.height_px < 1) return 0;
  std::bitset<kCellColumns * kCellRows> held;
  const auto hold = [&](double x, double y) {
    if (!std::isfinite(x) || !std::isfinite(y)) return;
    held.set(static_cast<std::size_t>(cell_of(y, query.height_px, kCellRows) * kCellColumns +
                                      cell_of(x, query.width_px, kCellColumns)));
  };
  std::size_t agreeing = matches.lines.size();
  for (const LineMatch& m : matches.lines)
    hold(query.lines[m.query].start_x_px, query.lines[m.query].start_y_px);
  for (const FeatureMatch& m : matches.points) {
    const Point& q = query.points[m.query];
    if (matches.rotation_rad &&
        !turns_with(q, candidate.points[m.candidate], *matches.rotation_rad))
      continue;
    hold(q.x_px, q.y_px);
    ++agreeing;
  }
  return static_cast<double>(agreeing) * std::sqrt(static_cast<double>(held.count()));
}

}  // namespace

class Verifier::Impl {
 public:
  explicit Impl(const VerifyConfig& config) : config_(config) {}

  void match(const Features& query, const Features& candidate, ImageMatches& out) {
    point_matcher_.match(query.point_descriptors, candidate.point_descriptors, config_, out.points);
    out.rotation_rad = rotation_from_points(query.points, candidate.points, out.points);
    if (config_.line_angle_filter)
      line_matcher_.match(query, candidate, config_, out.rotation_rad, out.lines);
    else
      line_matcher_.match_nndr(query, candidate, config_, out.rotation_rad, out.lines);
    out.promise = promise_of(query, candidate, out);
  }

  Verification check(const Features& query, const Features& candidate, const ImageMatches& matches,
                     std::uint64_t seed, InlierPairs& pairs) {
    pairs.clear();
    make_correspondences(query, candidate, matches.points, matches.lines, matches.rotation_rad,
                         config_.epipolar_px, c_);

    Random random(seed);
    const auto plane = find_homography(random);
    const auto epipolar = find_fundamental(plane ? &*plane : nullptr, random);

    Verification out;
    out.point_matches = static_cast<int>(matches.points.size());
    out.line_matches = static_cast<int>(matches.lines.size());
    if (plane) out.homography = homography_in_pixels(plane->forward, c_);
    if (epipolar) out.fundamental = fundamental_in_pixels(epipolar->fundamental, c_);
    choose(plane, epipolar, query, candidate, out);
    list_inliers(query, candidate, matches, pairs);
    out.point_inliers = count_distinct_points(pairs, query, candidate);
    measure_spread(pairs, query, out);
    return out;
  }

 private:
  // Leaves the residuals of the found model in homography_residuals_.
  std::optional<HomographyModel> find_homography(Random& random) {
    homography_residuals_.assign(c_.size(), 2.0);
    const int iterations = std::max(1, config_.max_iterations / kHomographyIterationShare);
    const auto found = estimate_homography(c_, iterations, random, scratch_);
    if (!found) return std::nullopt;
    HomographyEstimator::residuals(found->model, c_, 0, c_.size(), homography_residuals_);
    return found->model;
  }

  // Leaves the residuals of the found model in epipolar_residuals_.
  std::optional<EpipolarModel> find_fundamental(const HomographyModel* plane, Random& random) {
    epipolar_residuals_.assign(c_.size(), 2.0);
    const auto found = estimate_fundamental(c_, plane, config_.max_iterations, random, scratch_);
    if (!found) return std::nullopt;
    EpipolarEstimator::residuals(found->model, c_, 0, c_.size(), epipolar_residuals_);
    return found->model;
  }

  // Sets model and inlier counts of `out`, and chosen_residuals_.
  void choose(const std::optional<HomographyModel>& plane,
              const std::optional<EpipolarModel>& epipolar, const Features& query,
              const Features& candidate, Verification& out) {
    const Support h = support(c_, homography_residuals_), f = support(c_, epipolar_residuals_);
    out.homography_inliers = static_cast<int>(h.features());
    const bool planar =
        plane && h.features() >= kMinHomographyInliers &&
        static_cast<double>(h.features()) >= kHomographyShare * static_cast<double>(f.features());
    const bool spatial = !planar && epipolar && f.features() >= kMinEpipolarInliers;
    chosen_residuals_ = {};
    if (f.features() < kMinEpipolarInliers) out.fundamental = {};
    if (!planar && !spatial) return;
    if (planar) {
      const bool rotated = is_pure_rotation(*plane, c_, homography_residuals_, query, candidate);
      out.model = rotated ? Model::kRotation : Model::kHomography;
    }
    chosen_residuals_ = planar ? homography_residuals_ : epipolar_residuals_;
    out.agreeing = static_cast<int>(planar ? h.features() : f.features());
    out.line_inliers = static_cast<int>(planar ? h.lines : f.lines);
  }

  // Raw pixel positions of the entries that the chosen model explains, points first.
  void list_inliers(const Features& query, const Features& candidate, const ImageMatches& matches,
                    InlierPairs& pairs) const {
    if (chosen_residuals_.empty()) return;
    for (std::size_t i = 0; i < c_.points; ++i) {
      if (chosen_residuals_[i] > 1) continue;
      const FeatureMatch& m = matches.points[c_.point_match[i]];
      const Point &q = query.points[m.query], &p = candidate.points[m.candidate];
      pairs.push_back({q.x_px, q.y_px, p.x_px, p.y_px, false});
    }
    for (std::size_t i = 0; i < c_.lines; ++i) {
      const LineMatch& m = matches.lines[c_.line_match[i]];
      const Line &q = query.lines[m.query], &p = candidate.lines[m.candidate];
      const std::array<float, 2> start{p.start_x_px, p.start_y_px}, end{p.end_x_px, p.end_y_px};
      const auto &first = m.flipped ? end : start, &second = m.flipped ? start : end;
      if (chosen_residuals_[c_.points + i] <= 1)
        pairs.push_back({q.start_x_px, q.start_y_px, first[0], first[1], true});
      if (chosen_residuals_[c_.points + c_.lines + i] <= 1)
        pairs.push_back({q.end_x_px, q.end_y_px, second[0], second[1], true});
    }
  }

  VerifyConfig config_;
  PointMatcher point_matcher_;
  LineMatcher line_matcher_;
  Correspondences c_;
  RansacScratch scratch_;
  std::vector<double> homography_residuals_;
  std::vector<double> epipolar_residuals_;
  std::span<const double> chosen_residuals_;
};

Verifier::Verifier(const VerifyConfig& config) : impl_(std::make_unique<Impl>(config)) {}
Verifier::~Verifier() = default;

void Verifier::reserve(std::size_t points, std::size_t lines) {
  const Features all = scattered_features(points, lines);
  ImageMatches matches;
  InlierPairs pairs;
  match(all, all, matches);
  check(all, all, matches, 1, pairs);
}

void Verifier::match(const Features& query, const Features& candidate, ImageMatches& matches) {
  assert(query.points.size() == query.point_descriptors.size());
  assert(query.lines.size() == query.line_descriptors.size());
  assert(candidate.points.size() == candidate.point_descriptors.size());
  assert(candidate.lines.size() == candidate.line_descriptors.size());
  impl_->match(query, candidate, matches);
}

Verification Verifier::check(const Features& query, const Features& candidate,
                             const ImageMatches& matches, std::uint64_t seed, InlierPairs& pairs) {
  return impl_->check(query, candidate, matches, seed, pairs);
}

Verification Verifier::verify(const Features& query, const Features& candidate, std::uint64_t seed,
                              InlierPairs& pairs) {
  ImageMatches matches;
  match(query, candidate, matches);
  return check(query, candidate, matches, seed, pairs);
}

}  // namespace loopd
