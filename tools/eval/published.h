#pragma once

#include <filesystem>
#include <vector>

#include "base/result.h"
#include "eval/ground_truth.h"

namespace loopd::eval {

/// One image of a published iBoW-LCD run (Garcia-Fidalgo and Ortiz, RA-L 2018).
struct PublishedDetection {
  int query = 0;
  int island_first = 0;
  int island_last = 0;
  int match = 0;
  bool overlaps_last = false;  ///< its island overlaps that of the image before
  int inliers = 0;
};

/// Reads query, island_first, island_last, match, overlaps_last, inliers. Errors: as CsvReader.
Result<std::vector<PublishedDetection>> read_published(const std::filesystem::path& path);

/// Recall and precision as fractions, at the inlier threshold that reaches them.
struct PublishedRecall {
  double precision = 0;
  double recall = 0;
  int threshold = 0;
};

/// The rule behind the published recalls, for t = 1..500: an image is detected if more than
/// `consecutive` (C) detections ran up to it and its island overlaps the last one, or if its
/// inliers exceed t; a detection adds to the run, anything else ends it. The first `waiting` - 1
/// (W - 1) images and those with the island 0-0 are never detected and leave the run as it is. A
/// detection is right if a true match lies within `tolerance` images; recall = right / (right +
/// not detected though there is a match). Returns the largest recall at the largest precision.
PublishedRecall published_recall(const std::vector<PublishedDetection>& detections,
                                 const GroundTruth& truth, int waiting, int consecutive,
                                 int tolerance);

}  // namespace loopd::eval
