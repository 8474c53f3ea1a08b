#include "eval/score.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "eval/pr_plot.h"
#include "eval/score_command.h"
#include "support/temp_dir.h"

namespace loopd::eval {
namespace {

using loopd::testing::TempDir;
using ::testing::HasSubstr;

/// Queries 10..13 have matches: 10 -> 1, 11 -> 2, 12 -> 3, 13 -> 4; 10 -> 6 is don't care.
GroundTruth small_truth() {
  GroundTruth truth;
  truth.add(12, 3, Label::kSame);
  truth.add(10, 1, Label::kSame);
  truth.add(13, 4, Label::kSame);
  truth.add(11, 2, Label::kSame);
  truth.add(10, 6, Label::kDontCare);
  truth.finish();
  return truth;
}

TEST(GroundTruth, BestLabelWithinToleranceHolds) {
  const GroundTruth truth = small_truth();
  EXPECT_EQ(truth.label(10, 1, 0), Label::kSame);
  EXPECT_EQ(truth.label(10, 2, 0), Label::kDifferent);
  EXPECT_EQ(truth.label(10, 2, 1), Label::kSame);
  EXPECT_EQ(truth.label(10, 7, 1), Label::kDontCare);
  EXPECT_EQ(truth.label(10, 4, 3), Label::kSame) << "same place wins over don't care";
  EXPECT_EQ(truth.label(10, 0, 1), Label::kSame);
  EXPECT_EQ(truth.label(14, 1, 10'000), Label::kDifferent);
  EXPECT_THAT(truth.queries(), ::testing::ElementsAre(10, 11, 12, 13));
}

TEST(Score, SweepsDistinctScoresWithTiesTogether) {
  const std::vector<ScoredFrame> frames = {{9, std::nullopt, 0, false}, {10, 1, 50, true},  // right
                                           {11, 2, 40, true},                               // right
                                           {12, 3, 30, true},    // right, tied with
                                           {14, 5, 30, false},   // false
                                           {13, 9, 20, false}};  // false
  const Score score = score_frames(frames, small_truth(), 0);
  ASSERT_EQ(score.curve.size(), 4U);
  EXPECT_EQ(score.frames, 6U);
  EXPECT_EQ(score.candidates, 5U);
  EXPECT_EQ(score.queries_with_match, 4U);
  ASSERT_TRUE(score.full_precision);
  EXPECT_EQ(score.full_precision->threshold, 40);
  EXPECT_EQ(score.full_precision->counts.recall, 0.5);
  EXPECT_EQ(score.curve[2].threshold, 30);
  EXPECT_EQ(score.curve[2].counts.right, 3U);
  EXPECT_EQ(score.curve[2].counts.wrong, 1U);
  EXPECT_EQ(score.curve[2].counts.precision, 0.75);
  EXPECT_EQ(score.curve[3].counts.precision, 0.6);
  EXPECT_EQ(score.curve[3].counts.recall, 0.75);
  EXPECT_EQ(score.accepted.right, 3U);
  EXPECT_EQ(score.accepted.wrong, 0U);
  EXPECT_EQ(score.accepted.recall, 0.75);
}

TEST(Score, DontCareCountsNeitherWay) {
  const Score score = score_frames({{10, 6, 90, true}, {11, 2, 10, true}}, small_truth(), 0);
  ASSERT_EQ(score.curve.size(), 2U);
  EXPECT_EQ(score.curve[0].counts.dont_care, 1U);
  EXPECT_EQ(score.curve[0].counts.precision, 1);
  EXPECT_EQ(score.curve[0].counts.recall, 0);
  EXPECT_EQ(score.curve[1].counts.recall, 0.25);
  EXPECT_EQ(score.accepted.dont_care, 1U);
  EXPECT_EQ(score.accepted.precision, 1);
}

TEST(Score, ToleranceTurnsNearMissesRight) {
  const std::vector<ScoredFrame> frames = {{11, 5, 10, true}};
  EXPECT_EQ(score_frames(frames, small_truth(), 0).accepted.wrong, 1U);
  EXPECT_EQ(score_frames(frames, small_truth(), 2).accepted.wrong, 1U);
  EXPECT_EQ(score_frames(frames, small_truth(), 3).accepted.right, 1U);
}

TEST(Score, AllFalseHasNoThresholdWithoutAFalseOne) {
  const Score score = score_frames({{20, 1, 10, true}, {21, 1, 5, true}}, small_truth(), 0);
  EXPECT_FALSE(score.full_precision);
  EXPECT_EQ(score.accepted.precision, 0);
  EXPECT_EQ(score.accepted.recall, 0);
  EXPECT_EQ(score.queries_missing, 4U);
}

TEST(Score, NothingDetectedAndNoPositivesAreDefined) {
  const Score none = score_frames({{10, std::nullopt, 0, false}}, small_truth(), 0);
  EXPECT_TRUE(none.curve.empty());
  EXPECT_FALSE(none.full_precision);
  EXPECT_EQ(none.accepted.precision, 1);
  GroundTruth empty;
  empty.finish();
  const Score no_positives = score_frames({{10, 1, 3, true}}, empty, 0);
  EXPECT_EQ(no_positives.queries_with_match, 0U);
  EXPECT_EQ(no_positives.accepted.recall, 0);
  EXPECT_EQ(no_positives.accepted.wrong, 1U);
  EXPECT_TRUE(score_frames({}, empty, 0).curve.empty());
}

constexpr const char* kFrames =
    "query,file,outcome,match,inliers,similarity\n"
    "10,a.png,loop,1,50,0.2\n"
    "11,b.png,few_inliers,2,40,0.9\n"
    "12,c.png,no_candidates,,,\n"
    "14,d.png,few_inliers,5,30,0.1\n";
constexpr const char* kTruth = "query,match,label\n10,1,1\n11,2,1\n11,9,0.5\n12,3,1\n14,5,0\n";

TEST(Score, ReadsFilesByColumnName) {
  const TempDir dir;
  const auto frames = dir.write("frames.csv", kFrames);
  const auto truth = dir.write("groundtruth.csv", kTruth);
  const auto by_inliers = score_files(frames, truth, {});
  ASSERT_TRUE(by_inliers.ok()) << by_inliers.error().message;
  EXPECT_EQ(by_inliers.value().full_precision->threshold, 40);
  EXPECT_EQ(by_inliers.value().full_precision->counts.right, 2U);
  EXPECT_EQ(by_inliers.value().accepted.right, 1U);
  const auto by_similarity = score_files(frames, truth, {"similarity", 0});
  ASSERT_TRUE(by_similarity.ok());
  EXPECT_EQ(by_similarity.value().full_precision->threshold, 0.2);
}

/// The error of scoring these two texts.
std::string error_of(const std::string& frames, const std::string& truth,
                     const ScoreOptions& options = {}) {
  const TempDir dir;
  const auto score =
      score_files(dir.write("frames.csv", frames), dir.write("groundtruth.csv", truth), options);
  return score.ok() ? "" : score.error().message;
}

TEST(Score, HostileTablesGiveErrorsThatNameFileLineAndColumn) {
  const std::string header = "query,outcome,match,inliers\n";
  EXPECT_EQ(error_of(kFrames, kTruth), "");
  EXPECT_THAT(error_of("", kTruth), HasSubstr("frames.csv is empty"));
  EXPECT_THAT(error_of(kFrames, ""), HasSubstr("groundtruth.csv is empty"));
  EXPECT_THAT(error_of("query,outcome,match\n", kTruth), HasSubstr("no column \"inliers\""));
  EXPECT_THAT(error_of(kFrames, kTruth, {"beauty", 0}), HasSubstr("no column \"beauty\""));
  EXPECT_THAT(error_of(kFrames, "query,match\n"), HasSubstr("no column \"label\""));
  EXPECT_THAT(error_of(header + "x,loop,1,5\n", kTruth), HasSubstr("frames.csv:2: column query"));
  EXPECT_THAT(error_of(header + "1,few,-3,5\n", kTruth), HasSubstr("frames.csv:2: column match"));
  EXPECT_THAT(error_of(header + "1,few,3,\n", kTruth), HasSubstr("frames.csv:2: column inliers"));
  EXPECT_THAT(error_of(header + "1,few,3,nan\n", kTruth), HasSubstr("column inliers"));
  EXPECT_THAT(error_of(header + "1,loop,,\n", kTruth), HasSubstr("a loop must name its match"));
  EXPECT_THAT(error_of(header + "1,few,,\n1,few,,\n", kTruth),
              HasSubstr("frames.csv:3: column query: query 1 is there twice"));
  EXPECT_THAT(error_of(kFrames, "query,match,label\n1,2,0.7\n"),
              HasSubstr("groundtruth.csv:2: column label"));
  EXPECT_THAT(error_of(kFrames, kTruth, {"inliers", -1}), HasSubstr("tolerance = -1"));
  EXPECT_EQ(error_of(header, "query,match,label\n"), "") << "no rows is no error";
}

TEST(Score, AMillionRowsAreRead) {
  const TempDir dir;
  constexpr int kRows = 1'000'000;
  std::string text = "query,outcome,match,inliers\n";
  for (int i = 0; i < kRows; ++i) {
    text +=
        std::to_string(i) + ",loop," + std::to_string(i / 2) + "," + std::to_string(i % 300) + "\n";
  }
  const auto frames = dir.write("frames.csv", text);
  const auto truth = dir.write("groundtruth.csv", "query,match,label\n999999,499999,1\n");
  const auto score = score_files(frames, truth, {});
  ASSERT_TRUE(score.ok()) << score.error().message;
  EXPECT_EQ(score.value().frames, 1'000'000U);
  EXPECT_EQ(score.value().curve.size(), 300U);
  EXPECT_EQ(score.value().accepted.right, 1U);
}

/// Parses and runs `loopeval score` with `arguments`.
struct CommandRun {
  int code = 0;
  std::string out;
  std::string err;
};
CommandRun run_command(const std::vector<std::string>& arguments) {
  CLI::App app;
  ScoreCommand command;
  add_score_options(app, command);
  std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());
  app.parse(reversed);
  std::ostringstream out;
  std::ostringstream err;
  const int code = run_score(command, out, err);
  return {code, out.str(), err.str()};
}

TEST(ScoreCommand, PrintsTextAndWritesFiles) {
  const TempDir dir;
  const auto run =
      run_command({dir.write("frames.csv", kFrames).string(), dir.write("gt.csv", kTruth).string(),
                   "--out", (dir / "out").string()});
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("recall at 100 % precision: 66.67 % (2 of 3) at inliers >= 40"));
  EXPECT_THAT(run.out, HasSubstr("accepted loops: precision 100.00 %, recall 33.33 % (1 right"));
  std::ifstream csv(dir / "out/pr.csv");
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line, "threshold,precision,recall,right,wrong,dont_care");
  std::getline(csv, line);
  EXPECT_EQ(line, "50,1.000000,0.333333,1,0,0");
  std::ifstream png(dir / "out/pr.png", std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(png), {}};
  EXPECT_THAT(bytes, ::testing::StartsWith("\x89PNG"));
  EXPECT_GT(bytes.size(), 5000U);
}

TEST(ScoreCommand, PrintsJson) {
  const TempDir dir;
  const auto run =
      run_command({dir.write("frames.csv", kFrames).string(), dir.write("gt.csv", kTruth).string(),
                   "--json", "--tolerance", "1"});
  EXPECT_EQ(run.code, 0) << run.err;
  const auto json = nlohmann::json::parse(run.out);
  EXPECT_EQ(json["full_precision"]["threshold"], 40);
  EXPECT_EQ(json["tolerance"], 1);
  EXPECT_EQ(json["accepted"]["right"], 1);
  EXPECT_EQ(json["queries_with_match"], 3);
}

TEST(ScoreCommand, UndefinedFiguresAreSaidSo) {
  const TempDir dir;
  const auto frames = dir.write("frames.csv", "query,outcome,match,inliers\n1,few,,\n").string();
  const auto truth = dir.write("gt.csv", "query,match,label\n").string();
  EXPECT_THAT(run_command({frames, truth}).out, HasSubstr("undefined, no query has a match"));
  const auto json = nlohmann::json::parse(run_command({frames, truth, "--json"}).out);
  EXPECT_TRUE(json["recall_at_full_precision"].is_null());
  EXPECT_TRUE(json["accepted"]["precision"].is_null());
}

TEST(ScoreCommand, FailuresReturnOneWithASentence) {
  const TempDir dir;
  const auto frames = dir.write("frames.csv", kFrames).string();
  const auto missing = run_command({frames, (dir / "none.csv").string()});
  EXPECT_EQ(missing.code, 1);
  EXPECT_THAT(missing.err, HasSubstr("none.csv"));
  const auto blocked = run_command(
      {frames, dir.write("gt.csv", kTruth).string(), "--out", (dir / "frames.csv/x").string()});
  EXPECT_EQ(blocked.code, 1);
  EXPECT_THAT(blocked.err, HasSubstr("frames.csv/x"));
}

}  // namespace
}  // namespace loopd::eval
