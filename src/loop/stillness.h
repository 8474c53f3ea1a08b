#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "loopd/config.h"
#include "loopd/features.h"

namespace loopd {

/// Tells whether the camera has stood still between two images: of the features found again near
/// where they were, nearly all are exactly where they were. What is not found again (noise, people
/// walking by) does not count against it. Thread: one caller at a time.
class StillnessTest {
 public:
  explicit StillnessTest(const LoopConfig& config) : config_(config) {}

  bool is_still(const Features& before, const Features& now);

 private:
  struct Tally {
    std::size_t found = 0;    ///< features of `now` with a counterpart near the same place
    std::size_t unmoved = 0;  ///< of these, those within still_radius_px
  };
  Tally tally_points(const Features& before, const Features& now);
  Tally tally_lines(const Features& before, const Features& now) const;
  void sort_into_cells(const Features& before);

  LoopConfig config_;
  int columns_ = 1;
  int rows_ = 1;
  std::vector<std::uint32_t> cell_start_;  // points of `before`, sorted by grid cell
  std::vector<std::uint32_t> sorted_;
};

}  // namespace loopd
