#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "eval/ground_truth.h"

namespace loopd::eval {

struct ScoreOptions {
  std::string score_column = "inliers";
  int tolerance = 0;  ///< a match within so many images of a true one counts, 0..10000
};
inline constexpr int kMaxTolerance = 10'000;

/// What scoring needs of one row of frames.csv.
struct ScoredFrame {
  int query = 0;
  std::optional<int> match;  ///< none if no candidate reached verification
  double score = 0;          ///< only with `match`
  bool accepted = false;     ///< the detector called it a loop
};

/// Detections and what they are worth. Precision = right / (right + wrong), 1 if both are 0 (no
/// false detection was made); recall = right / queries that have a match, 0 if there is none.
struct Counts {
  std::size_t right = 0;
  std::size_t wrong = 0;
  std::size_t dont_care = 0;  ///< left out of both quotients
  double precision = 1;
  double recall = 0;
};

/// Counts when every row with a match and score >= threshold is a detection.
struct CurvePoint {
  double threshold = 0;
  Counts counts;
};

struct Score {
  std::size_t frames = 0;
  std::size_t candidates = 0;          ///< rows with a match
  std::size_t queries_with_match = 0;  ///< in the ground truth
  std::size_t queries_missing = 0;     ///< of those, not among the frames (they count as missed)
  std::vector<CurvePoint> curve;       ///< every distinct score, descending
  /// The largest recall without a false detection, at the lowest threshold that reaches it; none
  /// if even the highest score is false, or if no row has a match.
  std::optional<CurvePoint> full_precision;
  Counts accepted;  ///< the detector's own loops
};

/// Reads what scoring needs from a frames.csv (columns found by name: query, match, outcome and
/// the score column). Errors: as CsvReader; a query twice; a loop without a match; a match without
/// a score.
Result<std::vector<ScoredFrame>> read_frames(const std::filesystem::path& path,
                                             const std::string& score_column);

/// Sweeps the score. A detection is right if the best label within `tolerance` images of its match
/// is 1, left out if it is 0.5, else false. Rows of equal score enter the sweep together. A row is
/// a query each. Cost: n log n.
Score score_frames(const std::vector<ScoredFrame>& frames, const GroundTruth& truth, int tolerance);

/// read_frames, GroundTruth::read and score_frames in one.
Result<Score> score_files(const std::filesystem::path& frames,
                          const std::filesystem::path& ground_truth, const ScoreOptions& options);

}  // namespace loopd::eval
