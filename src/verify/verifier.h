#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "loopd/config.h"
#include "loopd/features.h"
#include "loopd/report.h"
#include "verify/line_matching.h"
#include "verify/matches.h"

namespace loopd {

using InlierPairs = FixedVector<InlierPair, Report::kMaxPairs>;

/// What the descriptors of two images have in common, before any geometry.
struct ImageMatches {
  std::vector<FeatureMatch> points;
  std::vector<LineMatch> lines;
  std::optional<double> rotation_rad;  ///< of the candidate against the query, where points tell
  /// How likely geometry will agree: matches that turn by the global rotation, times the root of
  /// the number of cells of the query that hold some. Only its order means something.
  double promise = 0;
  std::size_t size() const { return points.size() + lines.size(); }
};

/// Matches points and lines of two images and checks their epipolar geometry (DESIGN section 3,
/// steps 6 and 7; paper, section 2.5). Deterministic for a seed. Thread: one caller at a time.
class Verifier {
 public:
  explicit Verifier(const VerifyConfig& config);
  ~Verifier();

  /// Allocates all that images of at most so many features will need, by verifying one against
  /// itself. Throws std::bad_alloc.
  void reserve(std::size_t points, std::size_t lines);

  /// 6. Fills `matches`, which keeps its capacity. Any features are answered.
  void match(const Features& query, const Features& candidate, ImageMatches& matches);

  /// 7. Evidence that these matches of `query` and `candidate` show the same place. `pairs` is
  /// cleared and receives the inliers, points first.
  Verification check(const Features& query, const Features& candidate, const ImageMatches& matches,
                     std::uint64_t seed, InlierPairs& pairs);

  /// Both. Evidence that `query` and `candidate` show the same place. `pairs` is cleared and
  /// receives the inliers, points first. Any features are answered, empty ones with an empty
  /// Verification.
  Verification verify(const Features& query, const Features& candidate, std::uint64_t seed,
                      InlierPairs& pairs);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace loopd
