// Frame times: the window they hold images back for, and what happens when they lie.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "loop/detector_run.h"

namespace loopd {
namespace {

using testing::Image;
using testing::laps_of;
using testing::small_config;
using testing::TestRun;
using testing::walk;

constexpr std::int64_t kSecond = 1'000'000'000;

Config timed(double waiting_s) {
  Config config = small_config();
  config.loop.waiting_frames = 3;
  config.loop.waiting_s = waiting_s;
  return config;
}

TEST(DetectorTime, HoldsImagesBackForTheWindow) {
  TestRun run(timed(15));
  std::int64_t time_ns = 100 * kSecond;
  for (const Image& image : laps_of(walk(60), 1)) {
    const Report& r = run.see(image, time_ns);
    EXPECT_EQ(r.time_ns, time_ns);
    const std::int64_t passed = time_ns - 100 * kSecond;
    // Two images a second: all but those of the last 15 s, give or take the image at the edge.
    const std::int64_t older = passed * 2 / kSecond - 30;
    EXPECT_GE(static_cast<std::int64_t>(r.images), std::max<std::int64_t>(0, older - 1));
    EXPECT_LE(static_cast<std::int64_t>(r.images), std::max<std::int64_t>(0, older + 2));
    time_ns += kSecond / 2;
  }
}

TEST(DetectorTime, AViewIsFoundAfterTheWindowAndNotBefore) {
  for (const int gap_s : {10, 30}) {
    TestRun run(timed(15));
    const auto lap = laps_of(walk(2 * gap_s), 1);
    std::int64_t time_ns = 0;
    for (const Image& image : lap) {
      run.see(image, time_ns);
      time_ns += kSecond / 2;
    }
    const Report& r = run.see(lap[0], time_ns);
    EXPECT_EQ(r.outcome == Outcome::kLoop, gap_s == 30) << gap_s;
    if (gap_s == 30) {
      ASSERT_TRUE(r.match.has_value());
      EXPECT_EQ(r.match->image, 0u);
      EXPECT_EQ(r.match->time_ns, 0);
    }
  }
}

TEST(DetectorTime, WithoutTimesFramesAloneCount) {
  TestRun run(timed(86'400));
  const auto images = laps_of(walk(12), 2);
  for (std::size_t i = 0; i < images.size(); ++i) {
    const Report& r = run.see(images[i]);
    EXPECT_EQ(r.time_ns, std::nullopt);
    EXPECT_EQ(r.outcome == Outcome::kLoop, i >= 12) << i;
    if (r.match) {
      EXPECT_EQ(r.match->time_ns, std::nullopt);
    }
  }
}

/// Two laps of 12 views, the times of the second given by `second_lap(i)`; all of it is recognised
/// and the map never shrinks.
template <class Times>
void expect_recognised(const Times& second_lap) {
  TestRun run(timed(1));
  const auto images = laps_of(walk(12), 2);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const auto n = static_cast<std::int64_t>(i);
    const std::optional<std::int64_t> time_ns =
        i < 12 ? 1000 * kSecond + n * kSecond / 2 : second_lap(n);
    const Report& r = run.see(images[i], time_ns);
    EXPECT_EQ(r.query, i);
    EXPECT_EQ(r.time_ns, time_ns);
    EXPECT_EQ(r.outcome == Outcome::kLoop, i >= 12) << i << ' ' << outcome_name(r.outcome);
    EXPECT_GE(r.images, kept);
    kept = r.images;
  }
}

TEST(DetectorTime, MayJumpBack) {
  expect_recognised([](std::int64_t n) { return n * kSecond / 2; });
}

TEST(DetectorTime, MayRunBackwards) {
  expect_recognised([](std::int64_t n) { return 900 * kSecond - n * kSecond; });
}

TEST(DetectorTime, MayStandStill) {
  expect_recognised([](std::int64_t) { return 2000 * kSecond; });
}

TEST(DetectorTime, MayJumpFarAhead) {
  expect_recognised([](std::int64_t n) { return 1'000'000'000 * kSecond + n * kSecond / 2; });
}

TEST(DetectorTime, MayBeUnknownNowAndThen) {
  expect_recognised([](std::int64_t n) -> std::optional<std::int64_t> {
    if (n % 3 == 0) return std::nullopt;
    return 1000 * kSecond + n * kSecond / 2;
  });
}

TEST(DetectorTime, MayBeNegative) {
  expect_recognised([](std::int64_t n) { return (n - 500) * kSecond; });
}

TEST(DetectorTime, MayBeAnyNumber) {
  using Limits = std::numeric_limits<std::int64_t>;
  expect_recognised(
      [](std::int64_t n) { return n % 2 == 0 ? Limits::min() + n : Limits::max() - n; });
}

TEST(DetectorTime, TimesThatJumpDoNotHoldTheMapBackForEver) {
  TestRun run(timed(2));
  const auto lap = laps_of(walk(60), 1);
  std::int64_t time_ns = 0;
  for (std::size_t i = 0; i < lap.size(); ++i) {
    if (i == 10) time_ns = -1'000'000 * kSecond;
    if (i == 20) time_ns = 1'000'000 * kSecond;
    if (i == 30) time_ns = 0;
    run.see(lap[i], time_ns += kSecond / 2);
  }
  EXPECT_GE(run.report().images, 50u);
}

}  // namespace
}  // namespace loopd
