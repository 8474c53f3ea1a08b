#include "capture/frame_ledger.h"

#include <algorithm>

namespace loopd {
namespace {

// Faster than any camera this is for; what a counter leaps beyond it is no count of frames.
constexpr std::uint64_t kMaxFps = 2000;
constexpr std::uint64_t kSlackFrames = 64;
constexpr std::int64_t kSecond_ns = 1'000'000'000;

// Drivers that compute stamps from the device's own clock are some milliseconds wide of the truth.
constexpr std::int64_t kFutureTolerance_ns = 5'000'000;
// A frame may have been exposed while the stream was being started.
constexpr std::int64_t kOldTolerance_ns = kSecond_ns;

std::uint64_t most_frames_in(std::int64_t elapsed_ns) {
  const auto ms = static_cast<std::uint64_t>(std::max<std::int64_t>(elapsed_ns, 0) / 1'000'000);
  return ms * kMaxFps / 1000 + kSlackFrames;
}

}  // namespace

void SequenceLedger::begin(std::int64_t now_ns) {
  last_driver_.reset();
  last_ns_ = now_ns;
}

SequenceLedger::Entry SequenceLedger::enter(std::uint64_t driver_sequence,
                                            std::uint64_t passed_over, std::int64_t now_ns) {
  const std::uint64_t most = most_frames_in(now_ns - last_ns_);
  passed_over = std::min(passed_over, most);
  Entry entry{next_ + passed_over, 0};
  const bool stepped = last_driver_ && driver_sequence > *last_driver_;
  const std::uint64_t steps = stepped ? driver_sequence - *last_driver_ : 0;
  if (steps > passed_over + 1 && steps <= most) entry.lost = steps - passed_over - 1;
  entry.sequence += entry.lost;
  // The very first frame has the driver's own number; what was before it is not ours to count.
  if (!any_ && driver_sequence <= most) entry.sequence = std::max(entry.sequence, driver_sequence);
  any_ = true;
  last_driver_ = driver_sequence;
  last_ns_ = now_ns;
  next_ = entry.sequence + 1;
  return entry;
}

void StampJudge::begin(std::int64_t now_ns) {
  begin_ns_ = now_ns;
  last_stamp_ns_.reset();
}

StampJudge::Verdict StampJudge::judge(std::optional<std::int64_t> stamp_ns, std::int64_t now_ns) {
  Verdict verdict;
  verdict.fault = stamp_ns ? fault_of(*stamp_ns, now_ns) : StampFault::kMissing;
  if (verdict.fault == StampFault::kFuture) verdict.off_ns = *stamp_ns - now_ns;
  // A stamp within the tolerance is believed, but no frame is from the future.
  verdict.time_ns = verdict.fault ? now_ns : std::min(*stamp_ns, now_ns);
  // A true stamp may lie before the arrival that stood in for the stamp of the frame before.
  if (last_time_ns_) verdict.time_ns = std::max(verdict.time_ns, *last_time_ns_ + 1);
  last_time_ns_ = verdict.time_ns;
  last_stamp_ns_ = stamp_ns;
  return verdict;
}

std::optional<StampFault> StampJudge::fault_of(std::int64_t stamp_ns, std::int64_t now_ns) const {
  if (last_stamp_ns_ && stamp_ns == *last_stamp_ns_) return StampFault::kStill;
  if (last_stamp_ns_ && stamp_ns < *last_stamp_ns_) return StampFault::kBack;
  if (stamp_ns > now_ns && stamp_ns - now_ns > kFutureTolerance_ns) return StampFault::kFuture;
  if (stamp_ns < begin_ns_ - kOldTolerance_ns) return StampFault::kOld;
  return std::nullopt;
}

}  // namespace loopd
