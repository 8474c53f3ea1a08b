#include "app/liveness.h"

#include <algorithm>

#include "app/detect_loop.h"

namespace loopd {

bool Liveness::alive(const Vitals& vitals, std::int64_t now_ns) {
  const bool idle_for_a_reason = vitals.nothing_to_do && !vitals.work_pending;
  if (vitals.frames_detected != frames_seen_ || idle_for_a_reason) advanced_ns_ = now_ns;
  frames_seen_ = vitals.frames_detected;
  if (vitals.camera_answers != answers_seen_ || !vitals.camera_owes_answers) answered_ns_ = now_ns;
  answers_seen_ = vitals.camera_answers;
  if (idle_for_a_reason && now_ns - answered_ns_ > kLongestSilence_ns) return false;
  if (vitals.errors_in_row >= DetectLoop::kMostErrorsInRow) return false;
  return now_ns - advanced_ns_ <= patience_ns_;
}

std::int64_t patience_for(double fps, std::uint64_t watchdog_us) {
  const auto half_ns = static_cast<std::int64_t>(watchdog_us) * 500;
  if (fps <= 0) return half_ns;
  return std::max(half_ns, static_cast<std::int64_t>(5e9 / fps));
}

}  // namespace loopd
