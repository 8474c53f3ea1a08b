#include "verify/line_matching.h"

#include <algorithm>
#include <limits>

#include "base/hamming.h"
#include "verify/rotation.h"

namespace loopd {
namespace {

constexpr std::uint16_t kFar = std::numeric_limits<std::uint16_t>::max();
constexpr std::size_t kMinLineVotes = 8;

// Eq. 5: alpha = |theta_t - theta_c + theta_g|. The lines are directed (darker side fixed), so
// alpha is wrapped to [0, pi], not to [0, pi/2]: a line whose contrast flipped has another
// descriptor anyway, and the other edge of the same thin bar would pass as a rival. On two real
// sequences this gives 9 and 14 % more line inliers.
double relative_angle(double query_rad, double candidate_rad, double rotation_rad) {
  return absolute_angle(query_rad - candidate_rad + rotation_rad);
}

}  // namespace

std::span<const LineMatcher::Neighbour> LineMatcher::neighbours(std::size_t query) const {
  return {neighbours_.data() + query * neighbour_count_, neighbour_count_};
}

void LineMatcher::find_neighbours(const Features& query, const Features& candidate,
                                  std::size_t count) {
  const std::size_t total = candidate.line_descriptors.size();
  neighbour_count_ = std::min(count, total);
  all_are_neighbours_ = neighbour_count_ == total;
  neighbours_.resize(query.line_descriptors.size() * neighbour_count_);
  row_.resize(total);
  for (std::size_t i = 0; i < query.line_descriptors.size(); ++i) {
    hamming_distances(query.line_descriptors[i], candidate.line_descriptors, row_);
    Neighbour* const list = neighbours_.data() + i * neighbour_count_;
    std::size_t filled = 0;
    for (std::size_t j = 0; j < total; ++j) {
      if (filled == neighbour_count_ && row_[j] >= list[filled - 1].distance) continue;
      std::size_t k = filled < neighbour_count_ ? filled++ : filled - 1;
      for (; k > 0 && list[k - 1].distance > row_[j]; --k) list[k] = list[k - 1];
      list[k] = {row_[j], static_cast<std::uint32_t>(j)};
    }
  }
}

void LineMatcher::find_directions(const Features& query, const Features& candidate) {
  query_direction_rad_.resize(query.lines.size());
  candidate_direction_rad_.resize(candidate.lines.size());
  std::transform(query.lines.begin(), query.lines.end(), query_direction_rad_.begin(),
                 line_direction_rad);
  std::transform(candidate.lines.begin(), candidate.lines.end(), candidate_direction_rad_.begin(),
                 line_direction_rad);
}

std::optional<double> LineMatcher::rotation_from_neighbours() const {
  if (query_direction_rad_.size() < kMinLineVotes) return std::nullopt;
  DirectionHistogram differences;
  for (std::size_t i = 0; i < query_direction_rad_.size(); ++i) {
    const auto list = neighbours(i);
    if (list.empty()) continue;
    const auto q = query_direction_rad_[i], c = candidate_direction_rad_[list[0].line];
    if (q && c) differences.add(wrap_to_turn(*c - *q), 1);
  }
  return rotation_from_differences(differences);
}

void LineMatcher::select(const VerifyConfig& config, double max_angle_rad,
                         std::vector<LineMatch>& matches) {
  nearest_query_.assign(candidate_direction_rad_.size(), 0);
  nearest_query_distance_.assign(candidate_direction_rad_.size(), kFar);
  for (std::size_t i = 0; i < query_direction_rad_.size(); ++i) {
    if (!query_direction_rad_[i]) continue;
    const Neighbour* best = nullptr;
    std::optional<int> second;
    double best_angle = 0;
    for (const Neighbour& n : neighbours(i)) {
      const auto direction = candidate_direction_rad_[n.line];
      if (!direction) continue;
      const double alpha =
          rotation_rad_ ? relative_angle(*query_direction_rad_[i], *direction, *rotation_rad_) : 0;
      if (alpha > max_angle_rad) continue;
      if (n.distance < nearest_query_distance_[n.line]) {
        nearest_query_distance_[n.line] = n.distance;
        nearest_query_[n.line] = static_cast<std::uint32_t>(i);
      }
      if (best == nullptr) {
        best = &n;
        best_angle = alpha;
      } else if (!second) {
        second = n.distance;
      }
    }
    if (best == nullptr) continue;
    // A second survivor beyond the list is at least as far as the list reaches.
    if (!second && !all_are_neighbours_) second = neighbours(i).back().distance;
    const auto ratio = nndr(best->distance, second, config.line_ratio, config.max_line_distance);
    if (!ratio) continue;
    LineMatch match;
    match.query = static_cast<std::uint32_t>(i);
    match.candidate = best->line;
    match.distance = best->distance;
    match.ratio = *ratio;
    match.flipped = best_angle > kPi / 2;  // whichever pairing rotates the directed line less
    matches.push_back(match);
  }
  std::erase_if(matches,
                [&](const LineMatch& m) { return nearest_query_[m.candidate] != m.query; });
}

void LineMatcher::match(const Features& query, const Features& candidate,
                        const VerifyConfig& config, std::optional<double> rotation_rad,
                        std::vector<LineMatch>& matches) {
  matches.clear();
  find_neighbours(query, candidate, static_cast<std::size_t>(config.line_neighbours));
  find_directions(query, candidate);
  rotation_rad_ = rotation_rad;
  if (!rotation_rad_) rotation_rad_ = rotation_from_lines(query.lines, candidate.lines);
  if (!rotation_rad_) rotation_rad_ = rotation_from_neighbours();
  select(config, config.max_line_angle_deg * (kPi / 180), matches);
}

void LineMatcher::match_nndr(const Features& query, const Features& candidate,
                             const VerifyConfig& config, std::optional<double> rotation_rad,
                             std::vector<LineMatch>& matches) {
  matches.clear();
  find_neighbours(query, candidate, 2);
  find_directions(query, candidate);
  rotation_rad_ = rotation_rad;
  if (!rotation_rad_) rotation_rad_ = rotation_from_lines(query.lines, candidate.lines);
  select(config, 2 * kPi, matches);
}

}  // namespace loopd
