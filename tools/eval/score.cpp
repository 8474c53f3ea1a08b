#include "eval/score.h"

#include <algorithm>
#include <unordered_set>

#include "eval/csv_reader.h"

namespace loopd::eval {
namespace {

struct Columns {
  std::size_t query = 0;
  std::size_t match = 0;
  std::size_t outcome = 0;
  std::size_t score = 0;
};

Result<Columns> find_columns(const CsvReader& csv, const std::string& score_column) {
  Columns out;
  const std::pair<std::string, std::size_t*> wanted[] = {{"query", &out.query},
                                                         {"match", &out.match},
                                                         {"outcome", &out.outcome},
                                                         {score_column, &out.score}};
  for (const auto& [name, index] : wanted) {
    const auto column = csv.column(name);
    if (!column) return column.error();
    *index = column.value();
  }
  return out;
}

Result<ScoredFrame> read_row(const CsvReader& csv, const Columns& columns) {
  ScoredFrame frame;
  const auto query = csv.integer(columns.query, 0, kMaxImage);
  if (!query) return query.error();
  frame.query = static_cast<int>(query.value());
  frame.accepted = csv.text(columns.outcome) == "loop";
  if (csv.text(columns.match).empty()) {
    if (frame.accepted) return csv.error_at(columns.match, "a loop must name its match");
    return frame;
  }
  const auto match = csv.integer(columns.match, 0, kMaxImage);
  if (!match) return match.error();
  frame.match = static_cast<int>(match.value());
  const auto score = csv.real(columns.score);
  if (!score) return score.error();
  frame.score = score.value();
  return frame;
}

void count(Counts& counts, Label label) {
  if (label == Label::kSame) ++counts.right;
  if (label == Label::kDontCare) ++counts.dont_care;
  if (label == Label::kDifferent) ++counts.wrong;
}

void rate(Counts& counts, std::size_t queries_with_match) {
  const std::size_t judged = counts.right + counts.wrong;
  counts.precision =
      judged > 0 ? static_cast<double>(counts.right) / static_cast<double>(judged) : 1;
  counts.recall = queries_with_match > 0
                      ? static_cast<double>(counts.right) / static_cast<double>(queries_with_match)
                      : 0;
}

struct Detection {
  double score;
  Label label;
};

std::vector<CurvePoint> sweep(std::vector<Detection>& detections, std::size_t queries_with_match) {
  std::stable_sort(detections.begin(), detections.end(),
                   [](const Detection& a, const Detection& b) { return a.score > b.score; });
  std::vector<CurvePoint> curve;
  Counts counts;
  for (std::size_t i = 0; i < detections.size(); ++i) {
    count(counts, detections[i].label);
    if (i + 1 < detections.size() && detections[i + 1].score == detections[i].score) continue;
    rate(counts, queries_with_match);
    curve.push_back({detections[i].score, counts});
  }
  return curve;
}

/// False detections only grow as the threshold falls, so the last point without one is the best;
/// of points with the same recall the lowest threshold comes last.
std::optional<CurvePoint> best_without_false(const std::vector<CurvePoint>& curve) {
  std::optional<CurvePoint> best;
  for (const CurvePoint& point : curve) {
    if (point.counts.wrong > 0) break;
    best = point;
  }
  return best;
}

std::size_t count_missing(const std::vector<ScoredFrame>& frames, const GroundTruth& truth) {
  std::size_t present = 0;
  for (const ScoredFrame& frame : frames) present += truth.has_match(frame.query) ? 1 : 0;
  return truth.queries().size() - present;
}

}  // namespace

Result<std::vector<ScoredFrame>> read_frames(const std::filesystem::path& path,
                                             const std::string& score_column) {
  auto csv = CsvReader::open(path);
  if (!csv) return csv.error();
  const auto columns = find_columns(*csv, score_column);
  if (!columns) return columns.error();
  std::vector<ScoredFrame> frames;
  std::unordered_set<int> seen;
  while (true) {
    const auto some = csv->next();
    if (!some) return some.error();
    if (!some.value()) return frames;
    const auto frame = read_row(*csv, columns.value());
    if (!frame) return frame.error();
    if (!seen.insert(frame.value().query).second) {
      return csv->error_at(columns.value().query,
                           "query " + std::to_string(frame.value().query) + " is there twice");
    }
    frames.push_back(frame.value());
  }
}

Score score_frames(const std::vector<ScoredFrame>& frames, const GroundTruth& truth,
                   int tolerance) {
  Score out;
  out.frames = frames.size();
  out.queries_with_match = truth.queries().size();
  out.queries_missing = count_missing(frames, truth);
  std::vector<Detection> detections;
  for (const ScoredFrame& frame : frames) {
    if (!frame.match) continue;
    const Label label = truth.label(frame.query, *frame.match, tolerance);
    detections.push_back({frame.score, label});
    if (frame.accepted) count(out.accepted, label);
  }
  out.candidates = detections.size();
  rate(out.accepted, out.queries_with_match);
  out.curve = sweep(detections, out.queries_with_match);
  out.full_precision = best_without_false(out.curve);
  return out;
}

Result<Score> score_files(const std::filesystem::path& frames,
                          const std::filesystem::path& ground_truth, const ScoreOptions& options) {
  if (options.tolerance < 0 || options.tolerance > kMaxTolerance) {
    return Error{"tolerance = " + std::to_string(options.tolerance) + ". Violated: 0 <= tolerance" +
                     " <= " + std::to_string(kMaxTolerance),
                 0};
  }
  const auto rows = read_frames(frames, options.score_column);
  if (!rows) return rows.error();
  const auto truth = GroundTruth::read(ground_truth);
  if (!truth) return truth.error();
  return score_frames(rows.value(), truth.value(), options.tolerance);
}

}  // namespace loopd::eval
