// What the numbers and time stamps of drivers are worth.

#include "capture/frame_ledger.h"

#include <gtest/gtest.h>

#include <limits>

namespace loopd {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kSecond_ns = 1'000 * kMs;
constexpr std::uint64_t kHuge = std::numeric_limits<std::uint64_t>::max();

TEST(SequenceLedgerTest, GapsAreLostFramesAndThosePassedOverAreNot) {
  SequenceLedger ledger;
  ledger.begin(0);
  EXPECT_EQ(ledger.enter(0, 0, 33 * kMs).sequence, 0u);
  SequenceLedger::Entry entry = ledger.enter(1, 0, 66 * kMs);
  EXPECT_EQ(entry.sequence, 1u);
  EXPECT_EQ(entry.lost, 0u);
  entry = ledger.enter(5, 0, 200 * kMs);
  EXPECT_EQ(entry.sequence, 5u);
  EXPECT_EQ(entry.lost, 3u);
  entry = ledger.enter(9, 2, 300 * kMs);  // 6 to 8 are missing, two of them were given back
  EXPECT_EQ(entry.sequence, 9u);
  EXPECT_EQ(entry.lost, 1u);
  EXPECT_EQ(ledger.next(), 10u);
}

TEST(SequenceLedgerTest, TheVeryFirstFrameHasTheDriversNumber) {
  SequenceLedger ledger;
  ledger.begin(0);
  const SequenceLedger::Entry entry = ledger.enter(3, 0, 100 * kMs);
  EXPECT_EQ(entry.sequence, 3u);
  EXPECT_EQ(entry.lost, 0u);
  SequenceLedger hostile;
  hostile.begin(0);
  EXPECT_EQ(hostile.enter(kHuge, 0, 0).sequence, 0u);
}

TEST(SequenceLedgerTest, AnotherStreamGoesOnWhereTheLastOneEnded) {
  SequenceLedger ledger;
  ledger.begin(0);
  ledger.enter(40, 0, kSecond_ns);
  ledger.begin(2 * kSecond_ns);
  SequenceLedger::Entry entry = ledger.enter(0, 0, 3 * kSecond_ns);
  EXPECT_EQ(entry.sequence, 41u);
  EXPECT_EQ(entry.lost, 0u);
  ledger.begin(4 * kSecond_ns);
  EXPECT_EQ(ledger.enter(500, 0, 5 * kSecond_ns).sequence, 42u);
  EXPECT_EQ(ledger.enter(501, 0, 5 * kSecond_ns).sequence, 43u);
}

TEST(SequenceLedgerTest, ACounterThatTellsNothingLosesNothing) {
  SequenceLedger ledger;
  ledger.begin(0);
  std::uint64_t expected = 0;
  // Standing still, stepping back, leaping, wrapping.
  for (std::uint64_t driver : {0ul, 0ul, 0ul, 5ul, 4ul, 0xfffffffful, 0ul, 1ul << 60, kHuge, 0ul}) {
    const SequenceLedger::Entry entry = ledger.enter(driver, 0, 0);
    expected += 1 + entry.lost;
    EXPECT_EQ(entry.sequence + 1, expected);
    EXPECT_LE(entry.lost, 4u);
  }
  EXPECT_LT(ledger.enter(kHuge, kHuge, 0).sequence, 200u);
}

class StampJudgeTest : public ::testing::Test {
 protected:
  StampJudgeTest() { judge_.begin(kStart); }
  std::optional<StampFault> fault(std::optional<std::int64_t> stamp_ns, std::int64_t now_ns) {
    const StampJudge::Verdict verdict = judge_.judge(stamp_ns, now_ns);
    EXPECT_EQ(verdict.time_ns, verdict.fault ? now_ns : std::min(stamp_ns.value_or(0), now_ns));
    return verdict.fault;
  }

  static constexpr std::int64_t kStart = 100 * kSecond_ns;
  StampJudge judge_;
};

TEST_F(StampJudgeTest, StampsThatTickInThePastAreBelieved) {
  for (std::int64_t i = 1; i < 10; ++i)
    EXPECT_EQ(fault(kStart + i * 33 * kMs, kStart + i * 33 * kMs + 20 * kMs), std::nullopt);
  EXPECT_EQ(fault(kStart + kSecond_ns + 2 * kMs, kStart + kSecond_ns), std::nullopt)
      << "a little ahead is a matter of clocks";
}

TEST_F(StampJudgeTest, LiesAreNamed) {
  EXPECT_EQ(fault(std::nullopt, kStart), StampFault::kMissing);
  EXPECT_EQ(fault(kStart + 40 * kMs, kStart + 6 * kMs), StampFault::kFuture);
  EXPECT_EQ(fault(kStart + 40 * kMs, kStart + 50 * kMs), StampFault::kStill);
  EXPECT_EQ(fault(kStart + 39 * kMs, kStart + 70 * kMs), StampFault::kBack);
  EXPECT_EQ(fault(std::nullopt, kStart + 80 * kMs), StampFault::kMissing);
  EXPECT_EQ(fault(0, kStart + 90 * kMs), StampFault::kOld);
  EXPECT_EQ(fault(std::numeric_limits<std::int64_t>::max(), kStart + 91 * kMs),
            StampFault::kFuture);
  EXPECT_EQ(fault(std::numeric_limits<std::int64_t>::min(), kStart + 92 * kMs), StampFault::kBack);
  EXPECT_EQ(fault(kStart + 93 * kMs, kStart + 100 * kMs), std::nullopt) << "truth is taken again";
}

TEST_F(StampJudgeTest, ByHowMuchAStampIsAheadIsKnown) {
  EXPECT_EQ(judge_.judge(kStart + 34 * kMs, kStart).off_ns, 34 * kMs);
}

TEST_F(StampJudgeTest, TimesGrowThoughAnArrivalStoodIn) {
  // Frames every 33 ms that come 50 ms late; the stamp of the second is missing.
  std::int64_t last_ns = 0;
  int faults = 0;
  for (std::int64_t i = 1; i < 8; ++i) {
    const std::int64_t stamp_ns = kStart + i * 33 * kMs;
    const auto stamp = i == 2 ? std::nullopt : std::optional(stamp_ns);
    const StampJudge::Verdict verdict = judge_.judge(stamp, stamp_ns + 50 * kMs);
    EXPECT_GT(verdict.time_ns, last_ns);
    if (verdict.fault) ++faults;
    last_ns = verdict.time_ns;
    if (i == 7) {
      EXPECT_EQ(verdict.time_ns, stamp_ns) << "back to the stamps";
    }
  }
  EXPECT_EQ(faults, 1);
}

TEST_F(StampJudgeTest, AnotherStreamMayHaveAnotherClock) {
  fault(kStart + 50 * kMs, kStart + 60 * kMs);
  judge_.begin(kStart + kSecond_ns);
  const StampJudge::Verdict verdict =
      judge_.judge(kStart + 40 * kMs, kStart + kSecond_ns + 10 * kMs);
  EXPECT_EQ(verdict.fault, std::nullopt) << "from just before the stream";
  EXPECT_GT(verdict.time_ns, kStart + 50 * kMs) << "but no step back";
}

}  // namespace
}  // namespace loopd
