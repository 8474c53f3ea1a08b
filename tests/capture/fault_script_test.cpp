#include "capture/fault_script.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

namespace loopd {
namespace {

using ::testing::HasSubstr;

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kSecond = 1'000 * kMs;

FaultScript parsed(std::string_view script) {
  Result<FaultScript> result = FaultScript::parse(script);
  EXPECT_TRUE(result.ok()) << result.error().message;
  return result.ok() ? *result : FaultScript();
}

std::string mistakes(std::string_view script) {
  const Result<FaultScript> result = FaultScript::parse(script);
  EXPECT_FALSE(result.ok()) << script;
  return result.ok() ? "" : result.error().message;
}

TEST(FaultScript, ReadsTheExampleOfTheDocumentation) {
  const FaultScript script =
      parsed("stall@100:2s drop@50:3, corrupt@70 unplug@200:5s\njump@300:+3600s");
  ASSERT_EQ(script.faults().size(), 5u);
  EXPECT_EQ(script.faults()[0].kind, FaultKind::kDrop);
  EXPECT_EQ(script.faults()[0].frame, 50u);
  EXPECT_EQ(script.faults()[0].count, 3u);
  EXPECT_EQ(script.faults()[1].kind, FaultKind::kCorrupt);
  EXPECT_EQ(script.faults()[1].count, 1u);
  EXPECT_EQ(script.faults()[2].kind, FaultKind::kStall);
  EXPECT_EQ(script.faults()[2].duration_ns, 2 * kSecond);
  EXPECT_EQ(script.faults()[3].kind, FaultKind::kUnplug);
  EXPECT_EQ(script.faults()[4].kind, FaultKind::kJump);
  EXPECT_EQ(script.faults()[4].duration_ns, 3600 * kSecond);
}

TEST(FaultScript, NothingIsAScript) { EXPECT_TRUE(parsed("  , ").faults().empty()); }

TEST(FaultScript, Durations) {
  EXPECT_EQ(parsed("stall@0:1.5s").faults()[0].duration_ns, 1500 * kMs);
  EXPECT_EQ(parsed("stall@0:250ms").faults()[0].duration_ns, 250 * kMs);
  EXPECT_EQ(parsed("stall@0:2min").faults()[0].duration_ns, 120 * kSecond);
  EXPECT_EQ(parsed("jump@0:-1h").faults()[0].duration_ns, -3600 * kSecond);
  EXPECT_EQ(parsed("jump@0:5s").faults()[0].duration_ns, 5 * kSecond);
}

TEST(FaultScript, ListsEveryMistake) {
  const std::string message = mistakes(
      "freeze@3 stall@x:1s stall@5 drop@5:0 drop@5:2000000 unplug@1:-2s jump@2:1y corrupt@ "
      "drop@4:3 "
      "stall@1:2000000h @");
  EXPECT_THAT(message, HasSubstr("10 mistakes"));
  for (const char* mistake :
       {"\"freeze@3\"", "\"stall@x:1s\"", "\"stall@5\"", "\"drop@5:0\"", "\"drop@5:2000000\"",
        "\"unplug@1:-2s\"", "\"jump@2:1y\"", "\"corrupt@\"", "\"stall@1:2000000h\"", "\"@\""})
    EXPECT_THAT(message, HasSubstr(mistake));
}

TEST(FaultScript, HostileTextsAreMistakes) {
  for (const char* text :
       {"stall", "stall@", "stall@:", "stall@1:", "stall@1:s", "stall@1:nans", "stall@1:infs",
        "stall@1:1e9s", "stall@-1:1s", "drop@99999999999999999999", "jump@1:+-1s", "drop@1:1:1"})
    EXPECT_THAT(mistakes(text), HasSubstr("1 mistake:")) << text;
}

TEST(FaultScript, BreaksComeOnceAndInOrder) {
  FaultScript script = parsed("unplug@5:1s stall@3:1s stall@5:2s drop@4");
  EXPECT_EQ(script.take_break(2), nullptr);
  const Fault* first = script.take_break(5);
  ASSERT_NE(first, nullptr);
  EXPECT_EQ(first->frame, 3u);
  EXPECT_EQ(script.take_break(5)->kind, FaultKind::kUnplug);
  EXPECT_EQ(script.take_break(5)->duration_ns, 2 * kSecond);
  EXPECT_EQ(script.take_break(1000), nullptr);
}

TEST(FaultScript, DropsThatTouchAreOneGap) {
  const FaultScript script = parsed("drop@5:2 drop@7:3 drop@20");
  EXPECT_EQ(script.after_drops(4), 4u);
  EXPECT_EQ(script.after_drops(5), 10u);
  EXPECT_EQ(script.after_drops(9), 10u);
  EXPECT_EQ(script.after_drops(10), 10u);
  EXPECT_EQ(script.after_drops(20), 21u);
}

TEST(FaultScript, CorruptionAndJumps) {
  const FaultScript script = parsed("corrupt@5:2 jump@10:+1s jump@20:-3s");
  EXPECT_FALSE(script.corrupts(4));
  EXPECT_TRUE(script.corrupts(5));
  EXPECT_TRUE(script.corrupts(6));
  EXPECT_FALSE(script.corrupts(7));
  EXPECT_EQ(script.jump_ns(9), 0);
  EXPECT_EQ(script.jump_ns(10), kSecond);
  EXPECT_EQ(script.jump_ns(20), -2 * kSecond);
}

TEST(FaultScript, DiscardsWhatLiesBeforeTheStart) {
  FaultScript script = parsed("stall@1:1s jump@2:+1s corrupt@3 stall@9:1s");
  script.discard_before(4);
  ASSERT_EQ(script.faults().size(), 1u);
  EXPECT_EQ(script.take_break(9)->frame, 9u);
}

TEST(SaturatingAdd, HoldsAtTheEnds) {
  constexpr auto kMin = std::numeric_limits<std::int64_t>::min();
  constexpr auto kMax = std::numeric_limits<std::int64_t>::max();
  EXPECT_EQ(saturating_add(kMax, 1), kMax);
  EXPECT_EQ(saturating_add(kMin, -1), kMin);
  EXPECT_EQ(saturating_add(kMin, kMax), -1);
}

}  // namespace
}  // namespace loopd
