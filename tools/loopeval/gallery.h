#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "app/daemon_config.h"
#include "base/result.h"
#include "loopd/report.h"

namespace loopd::loopeval {

/// Keeps the most convincing loops of a run and draws them at its end. Memory: that of the kept
/// ones. Thread: one owner.
class Gallery {
 public:
  /// Keeps at most `capacity` loops.
  explicit Gallery(std::size_t capacity) : capacity_(capacity) {}

  /// Keeps `report` if it is a loop, and among the best so far, by the spread of its inliers over
  /// the view and then by their number. Of queries within 10 frames of each other, which look much
  /// alike, only the best is kept.
  void offer(const Report& report, const std::string& file);

  std::size_t size() const { return loops_.size(); }
  /// Queries of the kept loops, the best first.
  std::vector<std::uint64_t> queries() const;

  /// Reads the images again from the recording of `config` and writes a PNG for each loop into
  /// `folder` (made if missing; pictures of an earlier run are removed from it). Does nothing for a
  /// capacity of 0. Errors: an image cannot be read again; a file cannot be written.
  Status draw(DaemonConfig config, const std::filesystem::path& folder) const;

 private:
  struct Loop {
    std::uint64_t query = 0;
    std::uint64_t match = 0;
    int spread_inliers = 0;
    int inliers = 0;
    std::string caption;
    std::vector<InlierPair> pairs;
  };
  static bool better(const Loop& a, const Loop& b);
  static Loop loop_of(const Report& report, const std::string& file);

  const std::size_t capacity_;
  std::vector<Loop> loops_;  ///< best first
};

}  // namespace loopd::loopeval
