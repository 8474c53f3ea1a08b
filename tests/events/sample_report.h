#pragma once

#include "loopd/report.h"

namespace loopd::testing {

/// A verified loop with every field set to a value of its own.
inline Report sample_report() {
  Report report;
  report.query = 812;
  report.sequence = 18446744073709551615u;
  report.time_ns = 9007199254740993;  // 2^53 + 1: not a double
  report.outcome = Outcome::kLoop;
  report.island = Island{90, 101, 97, 0.1};
  report.match = Match{97, 98, -5, 0.61};
  Verification verification;
  verification.point_matches = 160;
  verification.line_matches = 40;
  verification.agreeing = 143;
  verification.point_inliers = 121;
  verification.line_inliers = 22;
  verification.model = Model::kHomography;
  verification.fundamental = {0, 1, 2, 3, 0.1, 5, 6, 1e-300, 8};
  verification.cells = 12;
  report.verification = verification;
  report.pairs.push_back({1.5f, 2, 3.25f, 0.1f, false});
  report.pairs.push_back({4, 5, 6, 1234.5677f, true});
  report.times = {20'000'000, 9'000'000, 7'000'000, 0, 0};
  return report;
}

}  // namespace loopd::testing
