#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "loopd/config.h"
#include "loopd/features.h"
#include "verify/matches.h"

namespace loopd {

/// A matched line with its one pairing of end points.
struct LineMatch : FeatureMatch {
  /// False: start with start, end with end. True: start with end (the contrast flipped).
  bool flipped = false;
  friend bool operator==(const LineMatch&, const LineMatch&) = default;
};

/// Matches lines of two images (paper, section 2.5.1). Holds only scratch memory.
/// Thread: one caller at a time.
class LineMatcher {
 public:
  /// The paper's method: of the `line_neighbours` nearest lines of the candidate those are kept
  /// whose direction agrees with the global rotation (Eq. 5, alpha <= `max_line_angle_deg`), and
  /// the best two survivors take the ratio test. `rotation_rad` is theta_g where it is already
  /// known (from points); otherwise the lines themselves are asked; where nobody knows, directions
  /// are not filtered. One-to-one: of the query lines that kept a candidate line the nearest has
  /// it (ties: lower index). Fills `matches` (cleared first), ordered by query index.
  void match(const Features& query, const Features& candidate, const VerifyConfig& config,
             std::optional<double> rotation_rad, std::vector<LineMatch>& matches);

  /// Plain ratio test on the two nearest lines, directions ignored but for the pairing of end
  /// points: the "NNDR" row of the paper's Table 1. One-to-one as above.
  void match_nndr(const Features& query, const Features& candidate, const VerifyConfig& config,
                  std::optional<double> rotation_rad, std::vector<LineMatch>& matches);

  /// theta_g of the last call, [0, 2 pi); none if it was not known.
  std::optional<double> rotation_rad() const { return rotation_rad_; }

 private:
  struct Neighbour {
    std::uint16_t distance = 0;
    std::uint32_t line = 0;
  };

  void find_neighbours(const Features& query, const Features& candidate, std::size_t count);
  void find_directions(const Features& query, const Features& candidate);
  std::optional<double> rotation_from_neighbours() const;
  void select(const VerifyConfig& config, double max_angle_rad, std::vector<LineMatch>& matches);
  std::span<const Neighbour> neighbours(std::size_t query) const;

  std::vector<std::uint16_t> row_;
  std::vector<Neighbour> neighbours_;  // neighbour_count_ a query line, nearest first
  std::size_t neighbour_count_ = 0;
  bool all_are_neighbours_ = false;  // the lists hold every line of the candidate
  std::vector<std::optional<double>> query_direction_rad_;
  std::vector<std::optional<double>> candidate_direction_rad_;
  std::vector<std::uint32_t> nearest_query_;  // by candidate line, among survivors
  std::vector<std::uint16_t> nearest_query_distance_;
  std::optional<double> rotation_rad_;
};

}  // namespace loopd
