#include "events/control_request.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <set>

namespace loopd {
namespace {

using ::testing::HasSubstr;

constexpr std::uint64_t kMib = 1024 * 1024;

std::string error_of(std::string_view line) {
  const ParsedControl parsed = parse_control(line);
  EXPECT_FALSE(parsed.op) << line;
  return parsed.error;
}

TEST(ControlRequest, EveryOpIsReadAsItIsWritten) {
  std::set<std::string_view> names;
  for (int i = 0; i <= static_cast<int>(ControlOp::kStopRecord); ++i) {
    const auto op = static_cast<ControlOp>(i);
    names.insert(control_op_name(op));
    const ParsedControl parsed = parse_control(control_request_text(op));
    EXPECT_EQ(parsed.op, op) << parsed.error;
    EXPECT_EQ(parsed.name, control_op_name(op));
  }
  EXPECT_EQ(names.size(), 7u);
}

TEST(ControlRequest, ARecordingHasItsBounds) {
  const ParsedControl parsed =
      parse_control(control_request_text(ControlOp::kRecord, {2.5, 300 * kMib}));
  EXPECT_EQ(parsed.limits.seconds, 2.5);
  EXPECT_EQ(parsed.limits.max_bytes, 300 * kMib);
  const ParsedControl by_default = parse_control(R"({"op":"record"})");
  EXPECT_EQ(by_default.limits.seconds, 60);
  EXPECT_EQ(by_default.limits.max_bytes, 1024 * kMib);
  const ParsedControl most = parse_control(R"({"op":"record","seconds":86400,"max_mib":1048576})");
  EXPECT_EQ(most.limits.max_bytes, RecordLimits::kMaxMib * kMib);
}

TEST(ControlRequest, BoundsThatAreNoneAreRefused) {
  for (const char* seconds : {"0", "-1", "86401", "1e300", "\"1\"", "null", "true", "[]"}) {
    const std::string line = std::string(R"({"op":"record","seconds":)") + seconds + "}";
    EXPECT_THAT(error_of(line), HasSubstr("\"seconds\" must be")) << line;
    EXPECT_EQ(parse_control(line).name, "record");
  }
  for (const char* mib : {"0", "-1", "1.5", "1048577", "18446744073709551615", "\"1\"", "null"}) {
    const std::string line = std::string(R"({"op":"record","max_mib":)") + mib + "}";
    EXPECT_THAT(error_of(line), HasSubstr("\"max_mib\" must be")) << line;
  }
  EXPECT_TRUE(parse_control(R"({"op":"status","seconds":"later"})").op) << "not its member";
}

TEST(ControlRequest, MistakesAreNamed) {
  EXPECT_THAT(error_of(""), HasSubstr("not JSON"));
  EXPECT_THAT(error_of("[1e999]"), HasSubstr("out of range"));
  EXPECT_THAT(error_of("7"), HasSubstr(R"(like {"op":"status"})"));
  EXPECT_THAT(error_of("{}"), HasSubstr("must name its \"op\""));
  EXPECT_THAT(error_of(R"({"op":"fly"})"),
              HasSubstr("unknown op \"fly\"; known are: status, pause, resume, reset, reload, "
                        "record, stop_record"));
  EXPECT_THAT(error_of(std::string(100'000, '[')), HasSubstr("nested deeper"));
  EXPECT_LT(error_of("{\"op\":\"" + std::string(5000, 'x') + "\"}").size(), 200u);
}

TEST(ControlRequest, AnswersKeepTheirTypesAndOrder) {
  const ControlFields fields{{"z", std::string("text \"\xff")},
                             {"a", std::int64_t{9007199254740993}},
                             {"rate", 2.5},
                             {"nan", std::numeric_limits<double>::quiet_NaN()},
                             {"on", true}};
  EXPECT_EQ(control_text("ok", "status", fields),
            "{\"class\":\"ok\",\"op\":\"status\",\"z\":\"text \\\"\xef\xbf\xbd\","
            "\"a\":9007199254740993,\"rate\":2.5,\"on\":true}");
  EXPECT_EQ(control_text("recorded", "", {}), R"({"class":"recorded"})");
  EXPECT_EQ(control_error_text("", "no"), R"({"class":"error","message":"no"})");
  EXPECT_EQ(control_error_text("pause", "no"), R"({"class":"error","op":"pause","message":"no"})");
}

}  // namespace
}  // namespace loopd
