#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/result.h"

namespace loopd::eval {

/// What the ground truth says of a pair.
enum class Label : std::uint8_t { kDifferent, kDontCare, kSame };

/// Largest image index accepted in any table.
inline constexpr std::int64_t kMaxImage = 100'000'000;

/// `groundtruth.csv` (query,match,label; 1 same place, 0.5 don't care, 0 or absent different).
/// Immutable after finish(); then reading is thread-safe.
class GroundTruth {
 public:
  /// Errors: as CsvReader; a label other than 0, 0.5 and 1.
  static Result<GroundTruth> read(const std::filesystem::path& path);

  /// For tables made in memory: add in any order, then finish(). The best label of a pair holds.
  void add(int query, int match, Label label);
  void finish();

  /// The best label of (query, match +- tolerance). Cost: O(log pairs + tolerance).
  Label label(int query, int match, int tolerance) const;
  /// Whether the query has at least one image of the same place.
  bool has_match(int query) const;
  /// The queries that have one, ascending.
  const std::vector<int>& queries() const { return queries_; }

 private:
  struct Pair {
    int query;
    int match;
    Label label;
  };
  std::vector<Pair> pairs_;  // ascending by query, match
  std::vector<int> queries_;
};

}  // namespace loopd::eval
