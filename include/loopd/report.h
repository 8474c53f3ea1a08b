#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "loopd/fixed_vector.h"

namespace loopd {

/// Number of a frame given to a detector, counted from 0, in order; every processed frame has one.
using ImageId = std::uint32_t;

/// What became of a frame. Everything but `kLoop` names the reason why there is no loop.
enum class Outcome : std::uint8_t {
  kLoop,          ///< a place seen before, verified geometrically
  kNoFeatures,    ///< too little in the image to say anything
  kMapEmpty,      ///< nothing searchable yet
  kNoCandidates,  ///< no earlier image is similar
  kFewMatches,    ///< the best candidate has too few matching points and lines
  kFewInliers,    ///< no epipolar geometry or homography holds for enough of them
  kContradicted,  ///< enough inliers, but too many of the matches disagree with them
  kError,         ///< processing this frame failed; the map is unchanged
};

/// Stable lower-case name, as in `frames.csv` and in events: "loop", "no_features", ...
std::string_view outcome_name(Outcome outcome);

/// An earlier image and how well it fits, in the unit of the list that holds it.
struct Candidate {
  ImageId image = 0;
  double score = 0;
};

/// A run of images close in time that were retrieved together (paper, section 2.4).
struct Island {
  ImageId first = 0;  ///< oldest image, inclusive
  ImageId last = 0;   ///< newest image, inclusive
  ImageId best = 0;   ///< its image with the highest fused score
  double score = 0;   ///< Eq. 4: fused scores summed over the images / number of images
};

/// Which two-view model explains the match best.
enum class Model : std::uint8_t { kFundamental, kHomography, kRotation };
std::string_view model_name(Model model);

/// One inlier correspondence in raw full-resolution pixels of the query and the matched image.
struct InlierPair {
  float query_x_px = 0;
  float query_y_px = 0;
  float match_x_px = 0;
  float match_y_px = 0;
  bool is_line = false;  ///< an end point of a line, else a point
};

/// Evidence of the geometric check of one candidate.
struct Verification {
  int point_matches = 0;  ///< matched points before the model
  int line_matches = 0;
  int agreeing = 0;  ///< matches, points + lines, that fit the model
  /// Agreeing points in distinct places: those in one of 48 x 48 cells (of either image) are the
  /// same evidence, since one corner answers on several pyramid levels, and count once.
  int point_inliers = 0;
  int line_inliers = 0;  ///< a line counts once, however many of its end points agree
  Model model = Model::kFundamental;
  /// Row-major; x_match^T F x_query = 0 in raw full-resolution pixels. All zero if none was found.
  std::array<double, 9> fundamental{};
  /// Row-major; x_match ~ H x_query. Only meaningful for homography and rotation.
  std::array<double, 9> homography{};
  int homography_inliers = 0;  ///< points + lines that agree with the best homography
  int cells = 0;               ///< of 8 x 6 cells of the query image, how many hold an inlier
  /// Inliers, each cell counting at most 4: how much of the view agrees, not how rich one poster
  /// is.
  int spread_inliers = 0;

  int inliers() const { return point_inliers + line_inliers; }
  int matches() const { return point_matches + line_matches; }
};

/// The earlier image that reached verification, accepted or not.
struct Match {
  ImageId image = 0;
  std::uint64_t sequence = 0;
  std::optional<std::int64_t> time_ns;
  double similarity = 0;  ///< fused score / length of the fused list's shorter side (beta / c)
};

/// Wall time of each stage, nanoseconds. Not part of the decision; differs from run to run.
struct StageTimes {
  std::int64_t features_ns = 0;
  std::int64_t search_ns = 0;
  std::int64_t verify_ns = 0;
  std::int64_t update_ns = 0;  ///< filled by absorb()
  std::int64_t total_ns = 0;   ///< frame taken to ready for the next, absorb included
};

/// Images that the memory budget has cost so far, by what there was no room for.
struct Evictions {
  std::uint64_t for_images = 0;  ///< searchable images, for the features of new ones
  std::uint64_t for_words = 0;   ///< searchable images, for the words of new ones
  std::uint64_t waiting = 0;     ///< images of the waiting window, which filled half the map
  std::uint64_t not_kept = 0;    ///< new images that found no room in the time a frame has
  friend bool operator==(const Evictions&, const Evictions&) = default;
};

/// Everything the detector decided about one frame and why. One per frame, whatever happened;
/// fixed capacity, meant to be reused. Daemon, tools and tests all read this one type.
struct Report {
  static constexpr std::size_t kMaxCandidates = 64;
  static constexpr std::size_t kMaxPairs = 4096;

  ImageId query = 0;
  std::uint64_t sequence = 0;  ///< Frame::sequence of the query
  std::optional<std::int64_t> time_ns;
  Outcome outcome = Outcome::kError;
  /// The camera has not moved since the last image kept; such a frame adds nothing to the map.
  bool still = false;

  int points = 0;  ///< features found in the query
  int lines = 0;
  FixedVector<Candidate, kMaxCandidates> point_candidates;  ///< Eq. 1 scores, best first
  FixedVector<Candidate, kMaxCandidates> line_candidates;
  FixedVector<Candidate, kMaxCandidates> fused;  ///< Eq. 2 and 3 scores, best first
  std::optional<Island> island;
  std::optional<Match> match;                ///< set when a candidate reached verification
  std::optional<Verification> verification;  ///< set together with `match`
  FixedVector<InlierPair, kMaxPairs> pairs;  ///< inliers of `match`; a line gives one or two

  StageTimes times;
  std::size_t words_points = 0;  ///< vocabulary sizes after absorb()
  std::size_t words_lines = 0;
  std::size_t images = 0;  ///< searchable images after absorb()
  std::size_t bytes = 0;   ///< of map and vocabularies in use after absorb()
  Evictions evictions;     ///< since the detector was made or cleared

  /// Back to the state of a new Report, keeping nothing.
  void clear();
};

}  // namespace loopd
