#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "loopd/features.h"
#include "verify/line_matching.h"
#include "verify/linear.h"
#include "verify/matches.h"

namespace loopd {

/// Corresponding positions of two images, of matched points and of both end points of matched
/// lines, as columns. Entry order: `points` points, then the start of every line (as seen in the
/// query), then, in the same order, its other end. Coordinates are normalised: x = (x_px - centre)
/// / scale with one scale for both images, so that distances are pixels / scale in both.
struct Correspondences {
  std::size_t points = 0;
  std::size_t lines = 0;
  std::vector<double> query_x, query_y, match_x, match_y;
  /// 1 / (tolerance in normalised units)^2, by entry.
  std::vector<double> inverse_tolerance_sq;
  /// Entries in the order of trust, best first: of points, and of line end points.
  std::vector<std::uint32_t> trusted_points, trusted_ends;
  std::vector<double> distrust;  ///< what the two lists are sorted by, by entry; 0 = best
  /// Indices into the matches they were made from, by point and by line.
  std::vector<std::uint32_t> point_match, line_match;

  std::array<double, 2> query_centre_px{}, match_centre_px{};
  double scale_px = 0;  ///< 0 if all positions of both images coincide or there are none

  std::size_t size() const { return query_x.size(); }
  std::size_t features() const { return points + lines; }  ///< a line counts once
  void clear();
};

/// Fills `out` (cleared first; its memory is reused) from matches of `query` and `candidate`.
/// Matches with a position that is not finite are left out. `rotation_rad` is the global rotation
/// theta_g if known. `tolerance_px` is the largest error of an inlier at the finest pyramid level;
/// coarser points, and lines of images that were reduced to find them, are allowed more.
void make_correspondences(const Features& query, const Features& candidate,
                          std::span<const FeatureMatch> point_matches,
                          std::span<const LineMatch> line_matches,
                          std::optional<double> rotation_rad, double tolerance_px,
                          Correspondences& out);

/// Maps between normalised and raw pixel coordinates: x_normalised = T x_px.
Mat3 normalisation(const std::array<double, 2>& centre_px, double scale_px);
Mat3 denormalisation(const std::array<double, 2>& centre_px, double scale_px);

}  // namespace loopd
