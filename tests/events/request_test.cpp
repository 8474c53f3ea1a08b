#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "events/records.h"

namespace loopd {
namespace {

using ::testing::HasSubstr;

std::string error_of(std::string_view line) {
  const ParsedRequest parsed = parse_request(line);
  EXPECT_FALSE(parsed.watch.has_value()) << line;
  EXPECT_FALSE(parsed.error.empty()) << line;
  return parsed.error;
}

TEST(Request, DefaultsAreLoopsAndStateWithoutPairs) {
  const ParsedRequest parsed = parse_request(R"({"op":"watch"})");
  ASSERT_TRUE(parsed.watch);
  EXPECT_EQ(parsed.watch->classes, (ClassSet{RecordClass::kLoop, RecordClass::kState}));
  EXPECT_FALSE(parsed.watch->pairs);
  EXPECT_FALSE(parsed.watch->since);
}

TEST(Request, TextReadsBackAsItWas) {
  WatchRequest request{{RecordClass::kCandidate, RecordClass::kStats},
                       true,
                       Since{"epoch \"x\"", 18446744073709551615u}};
  const ParsedRequest parsed = parse_request(request_text(request));
  ASSERT_TRUE(parsed.watch) << parsed.error;
  EXPECT_EQ(parsed.watch->classes, request.classes);
  EXPECT_TRUE(parsed.watch->pairs);
  EXPECT_EQ(parsed.watch->since->epoch, request.since->epoch);
  EXPECT_EQ(parsed.watch->since->seq, request.since->seq);
}

TEST(Request, NoClassesWatchesNothing) {
  const ParsedRequest parsed = parse_request(R"({"op":"watch","classes":[]})");
  ASSERT_TRUE(parsed.watch);
  EXPECT_TRUE(parsed.watch->classes.empty());
}

TEST(Request, UnknownMembersAreForLaterVersions) {
  EXPECT_TRUE(parse_request(R"({"op":"watch","later":{"x":[1]}})").watch);
}

TEST(Request, MistakesAreNamed) {
  EXPECT_THAT(error_of(""), HasSubstr("not JSON"));
  EXPECT_THAT(error_of("{\"op\":"), HasSubstr("not JSON: the mistake is near byte"));
  EXPECT_THAT(error_of("[1e999]"), HasSubstr("out of range"));
  EXPECT_THAT(error_of("{\"op\":\"w\xff\"}"), HasSubstr("not JSON"));
  EXPECT_THAT(error_of(std::string_view("\0\0", 2)), HasSubstr("not JSON"));
  EXPECT_THAT(error_of("[]"), HasSubstr("must be an object"));
  EXPECT_THAT(error_of("7"), HasSubstr("must be an object"));
  EXPECT_THAT(error_of("{}"), HasSubstr("\"op\""));
  EXPECT_THAT(error_of(R"({"op":3})"), HasSubstr("\"op\""));
  EXPECT_THAT(error_of(R"({"op":"fly"})"), HasSubstr("unknown op \"fly\""));
  EXPECT_THAT(error_of(R"({"op":"watch","classes":"loop"})"), HasSubstr("array of class names"));
  EXPECT_THAT(error_of(R"({"op":"watch","classes":[1]})"), HasSubstr("array of class names"));
  EXPECT_THAT(error_of(R"({"op":"watch","classes":["loops"]})"),
              HasSubstr("unknown class \"loops\"; known are: loop, candidate, state, stats"));
  EXPECT_THAT(error_of(R"({"op":"watch","pairs":1})"), HasSubstr("true or false"));
  for (const char* since : {"1", "{}", R"({"epoch":1,"seq":1})", R"({"epoch":"e"})",
                            R"({"epoch":"e","seq":-1})", R"({"epoch":"e","seq":1.5})"}) {
    EXPECT_THAT(error_of(std::string(R"({"op":"watch","since":)") + since + "}"),
                HasSubstr("\"since\" must be"));
  }
}

TEST(Request, QuotesOfTheClientAreShort) {
  const std::string op(5000, 'x');
  EXPECT_LT(error_of("{\"op\":\"" + op + "\"}").size(), 200u);
}

TEST(Request, DeepNestingIsRefusedBeforeParsing) {
  EXPECT_THAT(error_of(std::string(100'000, '[')), HasSubstr("nested deeper"));
  EXPECT_THAT(error_of("{\"op\":" + std::string(17, '{')), HasSubstr("nested deeper"));
  // Brackets inside text, also after an escaped quote, are no nesting.
  const std::string text(100, '[');
  EXPECT_TRUE(parse_request(R"({"op":"watch","note":"\")" + text + "\"}").watch);
}

}  // namespace
}  // namespace loopd
