#include "eval/ground_truth.h"

#include <algorithm>
#include <tuple>

#include "eval/csv_reader.h"

namespace loopd::eval {
namespace {

Result<Label> read_label(const CsvReader& csv, std::size_t column) {
  const auto value = csv.real(column);
  if (!value) return value.error();
  if (value.value() == 1) return Label::kSame;
  if (value.value() == 0.5) return Label::kDontCare;
  if (value.value() == 0) return Label::kDifferent;
  return csv.error_at(column, "a label is 1 (same place), 0.5 (don't care) or 0 (different)");
}

}  // namespace

Result<GroundTruth> GroundTruth::read(const std::filesystem::path& path) {
  auto csv = CsvReader::open(path);
  if (!csv) return csv.error();
  std::size_t columns[3] = {};
  const char* names[3] = {"query", "match", "label"};
  for (int i = 0; i < 3; ++i) {
    const auto column = csv->column(names[i]);
    if (!column) return column.error();
    columns[i] = column.value();
  }
  GroundTruth truth;
  while (true) {
    const auto some = csv->next();
    if (!some) return some.error();
    if (!some.value()) break;
    const auto query = csv->integer(columns[0], 0, kMaxImage);
    if (!query) return query.error();
    const auto match = csv->integer(columns[1], 0, kMaxImage);
    if (!match) return match.error();
    const auto label = read_label(*csv, columns[2]);
    if (!label) return label.error();
    truth.add(static_cast<int>(query.value()), static_cast<int>(match.value()), label.value());
  }
  truth.finish();
  return truth;
}

void GroundTruth::add(int query, int match, Label label) {
  if (label != Label::kDifferent) pairs_.push_back({query, match, label});
}

void GroundTruth::finish() {
  std::sort(pairs_.begin(), pairs_.end(), [](const Pair& a, const Pair& b) {
    return std::tie(a.query, a.match) < std::tie(b.query, b.match);
  });
  queries_.clear();
  for (const Pair& pair : pairs_) {
    if (pair.label != Label::kSame) continue;
    if (queries_.empty() || queries_.back() != pair.query) queries_.push_back(pair.query);
  }
}

Label GroundTruth::label(int query, int match, int tolerance) const {
  const std::int64_t first = std::int64_t{match} - tolerance;
  const std::int64_t last = std::int64_t{match} + tolerance;
  auto pair = std::lower_bound(pairs_.begin(), pairs_.end(), first,
                               [query](const Pair& p, std::int64_t from) {
                                 return p.query < query || (p.query == query && p.match < from);
                               });
  Label best = Label::kDifferent;
  for (; pair != pairs_.end() && pair->query == query && pair->match <= last; ++pair) {
    best = std::max(best, pair->label);
  }
  return best;
}

bool GroundTruth::has_match(int query) const {
  return std::binary_search(queries_.begin(), queries_.end(), query);
}

}  // namespace loopd::eval
