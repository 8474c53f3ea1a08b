#include "capture/libcamera_clock.h"

#include <gtest/gtest.h>

#include "base/clock.h"

namespace loopd {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kFrame_ns = kSecond_ns / 30;

ClockPair clocks(std::int64_t monotonic_ns, std::int64_t offset_ns) {
  return {monotonic_ns, monotonic_ns + offset_ns};
}

std::uint64_t stamp(std::int64_t ns) { return static_cast<std::uint64_t>(ns); }

TEST(LibcameraClock, BothClocksAreReadAtTheSameInstant) {
  const std::int64_t before_ns = monotonic_now_ns();
  const ClockPair pair = clock_pair_now();
  const std::int64_t after_ns = monotonic_now_ns();
  EXPECT_GE(pair.monotonic_ns, before_ns);
  EXPECT_LE(pair.monotonic_ns, after_ns);
  EXPECT_GE(pair.offset_ns(), -(after_ns - before_ns));
  EXPECT_LE(std::abs(clock_pair_now().offset_ns() - pair.offset_ns()), kSecond_ns / 100);
}

TEST(LibcameraClock, MonotonicStampsStayAsTheyAre) {
  StampClock clock;
  for (std::int64_t now = 50 * kSecond_ns; now < 51 * kSecond_ns; now += kFrame_ns) {
    const std::int64_t taken = now - 40'000'000;
    EXPECT_EQ(clock.to_monotonic_ns(stamp(taken), clocks(now, 900 * kSecond_ns)), taken);
  }
  EXPECT_EQ(clock.source(), StampClock::Source::kMonotonic);
}

TEST(LibcameraClock, BoottimeStampsLoseTheTimeAsleep) {
  StampClock clock;
  const std::int64_t asleep = 900 * kSecond_ns;
  for (std::int64_t now = 50 * kSecond_ns; now < 51 * kSecond_ns; now += kFrame_ns) {
    const std::int64_t taken = now - 40'000'000;
    EXPECT_EQ(clock.to_monotonic_ns(stamp(taken + asleep), clocks(now, asleep)), taken);
  }
  EXPECT_EQ(clock.source(), StampClock::Source::kBoottime);
}

TEST(LibcameraClock, StampsALittleInTheFutureAreStillOfTheirClock) {
  StampClock clock;
  const std::int64_t now = 50 * kSecond_ns;
  EXPECT_EQ(clock.to_monotonic_ns(stamp(now + 34'000'000), clocks(now, 2 * kSecond_ns)),
            now + 34'000'000);
  EXPECT_EQ(clock.source(), StampClock::Source::kMonotonic);
}

TEST(LibcameraClock, WhileTheClocksAgreeNothingIsDecided) {
  StampClock clock;
  const std::int64_t now = 50 * kSecond_ns;
  EXPECT_EQ(clock.to_monotonic_ns(stamp(now - 1000), clocks(now, 300)), now - 1000);
  EXPECT_EQ(clock.source(), StampClock::Source::kUndecided);
}

TEST(LibcameraClock, ZeroAndImpossibleStampsAreUnknown) {
  StampClock clock;
  const ClockPair now = clocks(50 * kSecond_ns, 0);
  EXPECT_EQ(clock.to_monotonic_ns(0, now), std::nullopt);
  EXPECT_EQ(clock.to_monotonic_ns(~std::uint64_t{0}, now), std::nullopt);
  EXPECT_TRUE(clock.to_monotonic_ns(~std::uint64_t{0} >> 1, now).has_value());
}

// Two frames of before a suspend of 100 s come after it, then new ones. `offset` is what the clocks
// differed by before; `boottime` says which clock the pipeline stamps with.
void expect_true_times_over_a_suspend(std::int64_t offset, bool boottime) {
  constexpr std::int64_t kAsleep_ns = 100 * kSecond_ns;
  StampClock clock;
  std::int64_t now = 50 * kSecond_ns;
  const auto convert = [&](std::int64_t taken, std::int64_t then_offset, std::int64_t now_offset) {
    return clock.to_monotonic_ns(stamp(taken + (boottime ? then_offset : 0)),
                                 clocks(now, now_offset));
  };
  for (int i = 0; i < 5; ++i, now += kFrame_ns)
    EXPECT_EQ(convert(now - 5'000'000, offset, offset), now - 5'000'000);
  const std::int64_t asleep_at = now;
  now += 20'000'000;
  const std::int64_t awake = offset + kAsleep_ns;
  EXPECT_EQ(convert(asleep_at - 60'000'000, offset, awake), asleep_at - 60'000'000);
  EXPECT_EQ(convert(asleep_at - 30'000'000, offset, awake), asleep_at - 30'000'000);
  for (int i = 0; i < 5; ++i) {
    now += kFrame_ns;
    EXPECT_EQ(convert(now - 5'000'000, awake, awake), now - 5'000'000) << i;
  }
}

TEST(LibcameraClock, SuspendWithMonotonicStamps) {
  expect_true_times_over_a_suspend(0, false);
  expect_true_times_over_a_suspend(7 * kSecond_ns, false);
}

TEST(LibcameraClock, SuspendWithBoottimeStamps) {
  expect_true_times_over_a_suspend(0, true);
  expect_true_times_over_a_suspend(7 * kSecond_ns, true);
}

}  // namespace
}  // namespace loopd
