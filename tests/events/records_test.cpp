#include "events/records.h"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "events/sample_report.h"

namespace loopd {
namespace {

using nlohmann::json;
using testing::sample_report;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr StreamPosition kPosition{"e1", 413};

TEST(Records, LoopTextIsTheDocumentedOne) {
  const Latency latency{2'000'999, 40'000'000};
  EXPECT_EQ(report_text(sample_report(), latency, kPosition, true),
            R"({"class":"loop","seq":413,"epoch":"e1",)"
            R"("query":{"id":812,"time_ns":9007199254740993,"frame_seq":18446744073709551615},)"
            R"("match":{"id":97,"time_ns":-5,"frame_seq":98},"similarity":0.61,)"
            R"("island":{"first":90,"last":101,"score":0.1},)"
            R"("inliers":{"points":121,"lines":22,"ratio":0.715,"spread":0.25},)"
            R"("model":"homography","F":[0.0,1.0,2.0,3.0,0.1,5.0,6.0,1e-300,8.0],)"
            R"("latency_us":{"capture":2000,"features":20000,"search":9000,"verify":7000,)"
            R"("total":40000},)"
            R"("pairs":[[1.5,2,3.25,0.1,"p"],[4,5,6,1234.5677,"l"]]})");
}

TEST(Records, PairsAreOnlyThereWhenAskedFor) {
  const json parsed = json::parse(report_text(sample_report(), {}, kPosition, false));
  EXPECT_FALSE(parsed.contains("pairs"));
  Report report = sample_report();
  report.pairs.clear();
  const json empty = json::parse(report_text(report, {}, kPosition, true));
  EXPECT_EQ(empty["pairs"], json::array());
}

TEST(Records, WhatIsNotKnownIsLeftOut) {
  Report report = sample_report();
  report.time_ns.reset();
  report.match->time_ns.reset();
  report.island.reset();
  report.verification->fundamental = {};
  const json parsed = json::parse(report_text(report, {}, kPosition, false));
  EXPECT_FALSE(parsed["query"].contains("time_ns"));
  EXPECT_FALSE(parsed["match"].contains("time_ns"));
  EXPECT_FALSE(parsed["latency_us"].contains("capture"));
  EXPECT_FALSE(parsed["latency_us"].contains("total"));
  for (const char* key : {"island", "F", "E", "q_match_query", "t_direction", "reason"}) {
    EXPECT_FALSE(parsed.contains(key)) << key;
  }
}

TEST(Records, RejectedCandidateNamesItsReason) {
  Report report = sample_report();
  report.outcome = Outcome::kFewInliers;
  ASSERT_EQ(record_class_of(report), RecordClass::kCandidate);
  const json parsed = json::parse(report_text(report, {}, kPosition, false));
  EXPECT_EQ(parsed["class"], "candidate");
  EXPECT_EQ(parsed["reason"], "few_inliers");
}

TEST(Records, CandidateWithoutAModelNamesNone) {
  Report report = sample_report();
  report.outcome = Outcome::kFewMatches;
  report.verification = Verification();
  const json parsed = json::parse(report_text(report, {}, kPosition, false));
  EXPECT_FALSE(parsed.contains("model"));
  EXPECT_FALSE(parsed["inliers"].contains("ratio"));  // 0 of 0
  EXPECT_EQ(parsed["inliers"]["points"], 0);
}

TEST(Records, ReportsWithoutVerificationAreNoRecord) {
  for (Outcome outcome :
       {Outcome::kNoFeatures, Outcome::kMapEmpty, Outcome::kNoCandidates, Outcome::kError}) {
    Report report;
    report.outcome = outcome;
    EXPECT_EQ(record_class_of(report), std::nullopt);
  }
}

TEST(Records, NothingThatIsNotFiniteReachesTheText) {
  Report report = sample_report();
  report.match->similarity = kNan;
  report.island->score = kInf;
  report.verification->fundamental[4] = -kInf;
  report.pairs.push_back({std::numeric_limits<float>::quiet_NaN(), 1, 1, 1, false});
  const std::string text = report_text(report, {}, kPosition, true);
  const json parsed = json::parse(text);
  EXPECT_EQ(text.find("null"), std::string::npos);
  EXPECT_EQ(text.find("nan"), std::string::npos);
  EXPECT_EQ(text.find("inf\""), std::string::npos);
  EXPECT_FALSE(parsed.contains("similarity"));
  EXPECT_FALSE(parsed["island"].contains("score"));
  EXPECT_FALSE(parsed.contains("F"));
  EXPECT_EQ(parsed["pairs"].size(), 2u);
}

TEST(Records, NumbersReadBackAsTheyWere) {
  Report report = sample_report();
  const double third = 1.0 / 3.0;
  report.match->similarity = third;
  report.verification->fundamental = {5e-324, 1.7976931348623157e308, third, -third, 0, 1, 2, 3, 4};
  report.time_ns = std::numeric_limits<std::int64_t>::max();
  report.pairs.clear();
  report.pairs.push_back({0.1f, 16777216.f, 1e-40f, 3.4028235e38f, true});
  const json parsed = json::parse(report_text(report, {}, kPosition, true));
  EXPECT_EQ(parsed["similarity"].get<double>(), third);
  EXPECT_EQ((parsed["F"].get<std::array<double, 9>>()), report.verification->fundamental);
  EXPECT_EQ(parsed["query"]["time_ns"].get<std::int64_t>(), *report.time_ns);
  const InlierPair& pair = report.pairs[0];
  EXPECT_EQ(static_cast<float>(parsed["pairs"][0][0].get<double>()), pair.query_x_px);
  EXPECT_EQ(static_cast<float>(parsed["pairs"][0][1].get<double>()), pair.query_y_px);
  EXPECT_EQ(static_cast<float>(parsed["pairs"][0][2].get<double>()), pair.match_x_px);
  EXPECT_EQ(static_cast<float>(parsed["pairs"][0][3].get<double>()), pair.match_y_px);
}

TEST(Records, LongestRecordFitsTheDefaultQueue) {
  Report report = sample_report();
  report.pairs.clear();
  while (report.pairs.push_back({1234.5677f, 2345.6788f, 3456.7898f, 4567.8906f, true})) {
  }
  EXPECT_LT(report_text(report, {}, kPosition, true).size(), 256u * 1024u);
}

TEST(Records, TextFromOutsideBecomesValidJson) {
  const std::string hostile = std::string("a\"\\\n\x1b\0", 6) + "\xff\xc0\xed\xa0\x80";
  StateRecord record{State::kCameraLost, 5, hostile, hostile};
  const std::string text = state_text(record, kPosition, false);
  EXPECT_EQ(text.find('\n'), std::string::npos);
  const json parsed = json::parse(text);  // throws for invalid UTF-8
  const std::string cause = parsed["cause"];
  EXPECT_EQ(cause.substr(0, 6), hostile.substr(0, 6));
  EXPECT_NE(cause.find("\xef\xbf\xbd"), std::string::npos);
  Identity identity;
  identity.camera = "\xfe";
  EXPECT_EQ(json::parse(hello_text(identity, kPosition))["camera"], "\xef\xbf\xbd");
  EXPECT_EQ(json::parse(error_text("\xfe", kPosition))["message"], "\xef\xbf\xbd");
}

TEST(Records, HelloTextIsTheDocumentedOne) {
  const Identity identity{"0.1.0", "front", "e1", "b1", "monotonic"};
  EXPECT_EQ(hello_text(identity, kPosition),
            R"({"class":"hello","name":"loopd","version":"0.1.0",)"
            R"("protocol":{"major":1,"minor":1},"epoch":"e1","seq":413,"camera":"front",)"
            R"("clock":"monotonic","boot_id":"b1"})");
}

TEST(Records, WatchTextEchoesThePolicy) {
  WatchRequest request;
  request.pairs = true;
  EXPECT_EQ(watch_text(request, {262144, 65536, 30000, 1048576}, kPosition),
            R"({"class":"watch","seq":413,"epoch":"e1","classes":["loop","state"],"pairs":true,)"
            R"("queue_bytes":262144,"max_line_bytes":65536,"stalled_client_ms":30000,)"
            R"("history_bytes":1048576})");
}

json echoed_since(const Resumed& resumed) {
  WatchRequest request;
  request.since = Since{"e0", 400};
  return json::parse(watch_text(request, {}, kPosition, resumed))["since"];
}

TEST(Records, SinceIsEchoedWithItsAnswer) {
  EXPECT_EQ(echoed_since({true, 0, ""}),
            (json{{"epoch", "e0"}, {"seq", 400}, {"resumed", true}, {"missed", 0}}));
  EXPECT_EQ(echoed_since({false, std::nullopt, "why"}),
            (json{{"epoch", "e0"}, {"seq", 400}, {"resumed", false}, {"reason", "why"}}));
}

TEST(Records, GapTextLeavesOutWhatIsNotKnown) {
  EXPECT_EQ(gap_text(Loss{}, kPosition), R"({"class":"gap","seq":413,"epoch":"e1"})");
  EXPECT_EQ(gap_text(Loss{3, 7, 12, "e0"}, kPosition),
            R"({"class":"gap","seq":413,"epoch":"e1","count":3,"first":7,"last":12,)"
            R"("of_epoch":"e0"})");
}

TEST(Records, StatsTextIsTheDocumentedOne) {
  StatsRecord record;
  record.time_ns = 1;
  record.uptime_ns = 2;
  record.frames = 3;
  record.dropped = 4;
  record.corrupt = 5;
  record.errors = 6;
  record.loops = 7;
  record.candidates = 8;
  record.images = 9;
  record.budget_bytes = 17;
  record.evictions = {18, 19, 20, 21};
  record.words_points = 10;
  record.words_lines = 11;
  record.bytes = 12;
  record.restamped = 15;
  record.camera_losses = 16;
  record.frame_rate_hz = 12.5;
  record.stage_means = StageTimes{1000, 2000, 3000, 4000, 10999};
  EXPECT_EQ(stats_text(record, {13, 14}, kPosition, true),
            R"({"class":"stats","seq":413,"epoch":"e1","repeat":true,"time_ns":1,"uptime_ns":2,)"
            R"("frames":3,"dropped":4,"corrupt":5,"errors":6,"loops":7,"candidates":8,"images":9,)"
            R"("words_points":10,"words_lines":11,"bytes":12,"budget_bytes":17,)"
            R"("evicted":{"for_images":18,"for_words":19,"waiting":20,"not_kept":21},"restamped":15,"camera_losses":16,)"
            R"("frame_rate_hz":12.5,)"
            R"("mean_us":{"features":1,"search":2,"verify":3,"update":4,"total":10},)"
            R"("clients":13,"missed_records":14})");
  record.frame_rate_hz = kNan;
  record.stage_means.reset();
  const json parsed = json::parse(stats_text(record, {}, kPosition, false));
  for (const char* key : {"frame_rate_hz", "mean_us", "repeat"}) {
    EXPECT_FALSE(parsed.contains(key)) << key;
  }
}

TEST(Records, EveryStateHasItsOwnName) {
  std::set<std::string_view> names;
  for (int i = 0; i <= static_cast<int>(State::kShuttingDown); ++i) {
    names.insert(state_name(static_cast<State>(i)));
  }
  EXPECT_EQ(names.size(), 10u);
  EXPECT_EQ(state_name(State::kPaused), "paused");
  EXPECT_EQ(state_name(State::kMapReset), "map_reset");
  EXPECT_EQ(state_name(State::kShuttingDown), "shutting_down");
}

}  // namespace
}  // namespace loopd
