#include "capture/libcamera_clock.h"

#include <time.h>

#include <cstdlib>
#include <limits>

#include "base/clock.h"

namespace loopd {
namespace {

// Below this the clocks count as equal; a suspend takes longer.
constexpr std::int64_t kSame_ns = 1'000'000;

std::int64_t boottime_now_ns() {
  timespec now{};
  clock_gettime(CLOCK_BOOTTIME, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

}  // namespace

ClockPair clock_pair_now() {
  ClockPair best;
  std::int64_t best_gap_ns = std::numeric_limits<std::int64_t>::max();
  for (int tries = 0; tries < 3; ++tries) {
    const std::int64_t before_ns = monotonic_now_ns();
    const std::int64_t boottime_ns = boottime_now_ns();
    const std::int64_t gap_ns = monotonic_now_ns() - before_ns;
    if (gap_ns >= best_gap_ns) continue;
    best_gap_ns = gap_ns;
    best = {before_ns + gap_ns / 2, boottime_ns};
  }
  return best;
}

std::optional<std::int64_t> StampClock::to_monotonic_ns(std::uint64_t stamp_ns, ClockPair now) {
  constexpr auto kMax = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
  follow(now);
  if (stamp_ns == 0 || stamp_ns > kMax) return std::nullopt;
  const auto stamp = static_cast<std::int64_t>(stamp_ns);
  // By the old offset a BOOTTIME stamp of after the suspend would lie as far in the future as the
  // suspend took. (A stamp of before it tells nothing about which clock it is.)
  const bool before_suspend = changed_ns_ != 0 && stamp - previous_ns_ <= changed_ns_;
  if (source_ == Source::kUndecided && !before_suspend) decide(stamp, now);
  if (source_ != Source::kBoottime) return stamp;
  return stamp - (before_suspend ? previous_ns_ : offset_ns_);
}

void StampClock::decide(std::int64_t stamp_ns, ClockPair now) {
  if (std::abs(now.offset_ns()) < kSame_ns) return;
  const bool boottime =
      std::abs(now.boottime_ns - stamp_ns) < std::abs(now.monotonic_ns - stamp_ns);
  source_ = boottime ? Source::kBoottime : Source::kMonotonic;
}

void StampClock::follow(ClockPair now) {
  if (known_ && std::abs(now.offset_ns() - offset_ns_) >= kSame_ns) {
    previous_ns_ = offset_ns_;
    changed_ns_ = now.monotonic_ns;
  }
  offset_ns_ = now.offset_ns();
  known_ = true;
}

}  // namespace loopd
