#include "capture/times_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace loopd {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::int64_t> times(std::string_view text) {
  const Result<std::vector<std::int64_t>> result = parse_times(text);
  EXPECT_TRUE(result.ok()) << result.error().message;
  return result.ok() ? result.value() : std::vector<std::int64_t>{-999};
}

TEST(TimesFile, SecondsAreExactToTheNanosecond) {
  EXPECT_THAT(times("1403636579.763555526\n1403636579.813555456\n"),
              ElementsAre(1403636579763555526, 1403636579813555456));
  EXPECT_THAT(times("0.000000e+00\n1.036224e-01\n2.5E1\n"), ElementsAre(0, 103622400, 25000000000));
  EXPECT_THAT(times("-0.5\n+.25\n3.\n"), ElementsAre(-500000000, 250000000, 3000000000));
  EXPECT_THAT(times("0.1234567899\n"), ElementsAre(123456789));
}

TEST(TimesFile, WholeNumbersWithLargeStepsAreNanoseconds) {
  EXPECT_THAT(times("1403636579763555584\n1403636579813555456\n"),
              ElementsAre(1403636579763555584, 1403636579813555456));
  EXPECT_THAT(times("0\n33333333\n66666666\n"), ElementsAre(0, 33333333, 66666666));
  EXPECT_THAT(times("1403636579763555584\n"), ElementsAre(1403636579763555584));
}

TEST(TimesFile, WholeNumbersWithSmallStepsAreSeconds) {
  EXPECT_THAT(times("0\n1\n2\n"), ElementsAre(0, 1000000000, 2000000000));
  EXPECT_THAT(times("1403636579\n1403636580\n"),
              ElementsAre(1403636579000000000, 1403636580000000000));
  EXPECT_THAT(times("5\n"), ElementsAre(5000000000));
}

TEST(TimesFile, SkipsBlankLinesAndCommentsAndTakesForeignLineEnds) {
  EXPECT_THAT(times("# seconds\r\n\r\n  1.5 \r\n\t2.5"), ElementsAre(1500000000, 2500000000));
  EXPECT_THAT(times(""), IsEmpty());
}

TEST(TimesFile, NamesTheBadLine) {
  for (const char* bad :
       {"x", "1 2", "1,2", "1.2.3", "1e", "1e999", "nan", "inf", "0x10", "-", "."})
    EXPECT_THAT(parse_times("# first\n1.0\n" + std::string(bad) + "\n").error().message,
                HasSubstr("line 3"))
        << bad;
  EXPECT_THAT(parse_times("1.0\n99999999999.0\n").error().message,
              HasSubstr("line 2 is out of range"));
  EXPECT_THAT(parse_times("1.0\n" + std::string(500, '9')).error().message, HasSubstr("line 2"));
}

}  // namespace
}  // namespace loopd
