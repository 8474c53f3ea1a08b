#include "eval/published.h"

#include <cstddef>
#include <string>
#include <utility>

#include "eval/csv_reader.h"

namespace loopd::eval {
namespace {

constexpr int kMaxThreshold = 500;

struct Tally {
  int right = 0;
  int wrong = 0;
  int missed = 0;
};

double quotient(int part, int rest) {
  return part + rest > 0 ? static_cast<double>(part) / (part + rest) : 0;
}

Tally tally(const std::vector<PublishedDetection>& detections, const GroundTruth& truth,
            int waiting, int consecutive, int tolerance, int threshold) {
  Tally out;
  int run = 0;
  for (const PublishedDetection& d : detections) {
    const bool none = d.island_first == 0 && d.island_last == 0;
    bool detected = false;
    if (d.query >= waiting - 1 && !none) {
      detected = (run > consecutive && d.overlaps_last) || d.inliers > threshold;
      run = detected ? run + 1 : 0;
    }
    if (!detected) {
      out.missed += truth.has_match(d.query) ? 1 : 0;
    } else if (truth.label(d.query, d.match, tolerance) == Label::kSame) {
      ++out.right;
    } else {
      ++out.wrong;
    }
  }
  return out;
}

}  // namespace

Result<std::vector<PublishedDetection>> read_published(const std::filesystem::path& path) {
  auto csv = CsvReader::open(path);
  if (!csv) return csv.error();
  constexpr int kColumns = 6;
  const char* names[kColumns] = {"query", "island_first",  "island_last",
                                 "match", "overlaps_last", "inliers"};
  std::size_t columns[kColumns] = {};
  for (int i = 0; i < kColumns; ++i) {
    const auto column = csv->column(names[i]);
    if (!column) return column.error();
    columns[i] = column.value();
  }
  std::vector<PublishedDetection> out;
  while (true) {
    const auto some = csv->next();
    if (!some) return some.error();
    if (!some.value()) return out;
    int values[kColumns] = {};
    for (int i = 0; i < kColumns; ++i) {
      const auto value = csv->integer(columns[i], 0, kMaxImage);
      if (!value) return value.error();
      values[i] = static_cast<int>(value.value());
    }
    out.push_back({values[0], values[1], values[2], values[3], values[4] != 0, values[5]});
  }
}

PublishedRecall published_recall(const std::vector<PublishedDetection>& detections,
                                 const GroundTruth& truth, int waiting, int consecutive,
                                 int tolerance) {
  PublishedRecall best;
  for (int threshold = 1; threshold <= kMaxThreshold; ++threshold) {
    const Tally t = tally(detections, truth, waiting, consecutive, tolerance, threshold);
    const double precision = quotient(t.right, t.wrong);
    const double recall = quotient(t.right, t.missed);
    if (std::pair(precision, recall) > std::pair(best.precision, best.recall)) {
      best = {precision, recall, threshold};
    }
  }
  return best;
}

}  // namespace loopd::eval
