#pragma once

#include <cstdint>
#include <memory>

#include "loopd/config.h"
#include "loopd/features.h"
#include "loopd/report.h"

namespace loopd {

using InlierPairs = FixedVector<InlierPair, Report::kMaxPairs>;

/// Matches points and lines of two images and checks their epipolar geometry (DESIGN section 3,
/// steps 6 and 7; paper, section 2.5). Deterministic for a seed. Thread: one caller at a time.
class Verifier {
 public:
  explicit Verifier(const VerifyConfig& config);
  ~Verifier();

  /// Evidence that `query` and `candidate` show the same place. `pairs` is cleared and receives the
  /// inliers, points first. Any features are answered, empty ones with an empty Verification.
  Verification verify(const Features& query, const Features& candidate, std::uint64_t seed,
                      InlierPairs& pairs);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace loopd
