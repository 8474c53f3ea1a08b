#include "loopd/features.h"
#include "loopd/report.h"

namespace loopd {

std::string_view outcome_name(Outcome outcome) {
  switch (outcome) {
    case Outcome::kLoop:
      return "loop";
    case Outcome::kNoFeatures:
      return "no_features";
    case Outcome::kMapEmpty:
      return "map_empty";
    case Outcome::kNoCandidates:
      return "no_candidates";
    case Outcome::kFewMatches:
      return "few_matches";
    case Outcome::kFewInliers:
      return "few_inliers";
    case Outcome::kContradicted:
      return "contradicted";
    case Outcome::kError:
      return "error";
  }
  return "unknown";
}

std::string_view model_name(Model model) {
  switch (model) {
    case Model::kFundamental:
      return "fundamental";
    case Model::kHomography:
      return "homography";
    case Model::kRotation:
      return "rotation";
  }
  return "unknown";
}

void Features::clear() {
  points.clear();
  point_descriptors.clear();
  lines.clear();
  line_descriptors.clear();
  width_px = 0;
  height_px = 0;
}

std::size_t Features::bytes() const {
  return points.capacity() * sizeof(Point) + point_descriptors.capacity() * sizeof(Descriptor) +
         lines.capacity() * sizeof(Line) + line_descriptors.capacity() * sizeof(Descriptor);
}

void Report::clear() {
  // Field by field, since the fixed-capacity lists are large and need only their sizes reset.
  query = 0;
  sequence = 0;
  time_ns.reset();
  outcome = Outcome::kError;
  still = false;
  points = 0;
  lines = 0;
  point_candidates.clear();
  line_candidates.clear();
  fused.clear();
  island.reset();
  match.reset();
  verification.reset();
  pairs.clear();
  times = {};
  words_points = 0;
  words_lines = 0;
  images = 0;
  bytes = 0;
  evictions = {};
}

}  // namespace loopd
