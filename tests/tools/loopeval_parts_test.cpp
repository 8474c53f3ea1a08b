#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "loopeval/frames_csv.h"
#include "loopeval/gallery.h"
#include "loopeval/summary.h"
#include "support/temp_dir.h"

namespace loopd::loopeval {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr std::ptrdiff_t kCommas = 27;

std::unique_ptr<Report> loop_report(ImageId query, int spread_inliers) {
  auto report = std::make_unique<Report>();
  report->query = query;
  report->sequence = query + 100;
  report->outcome = Outcome::kLoop;
  report->island = Island{.first = 1, .last = 2, .best = 1, .score = 0.5};
  report->match = Match{.image = 1, .sequence = 101, .time_ns = {}, .similarity = 0.1};
  report->verification.emplace();
  report->verification->point_inliers = 30;
  report->verification->line_inliers = 4;
  report->verification->spread_inliers = spread_inliers;
  return report;
}

TEST(FramesCsv, RowNamesImagesByTheirNumberInTheRecording) {
  const auto report = loop_report(3, 20);
  report->times.total_ns = 1'234'500;
  const std::vector<std::uint64_t> sequences = {100, 101, 105, 103};
  const std::string row = report_row(*report, "a.png", sequences);
  EXPECT_THAT(row, StartsWith("103,a.png,loop,101,101,105,0.1,30,4,34,0.000,0.000,0.000,0.000,"
                              "1.235,"));
  EXPECT_EQ(std::count(row.begin(), row.end(), ','), kCommas);
}

TEST(FramesCsv, EveryRowHasTheHeadersFields) {
  EXPECT_EQ(std::count(kFramesHeader.begin(), kFramesHeader.end(), ','), kCommas);
  const std::string nothing = report_row(Report(), "", {});
  EXPECT_EQ(std::count(nothing.begin(), nothing.end(), ','), kCommas);
  const std::string unreadable = unreadable_row(7, "b.jpg");
  EXPECT_THAT(unreadable, StartsWith("7,b.jpg,unreadable,,"));
  EXPECT_EQ(std::count(unreadable.begin(), unreadable.end(), ','), kCommas);
}

TEST(FramesCsv, AwkwardFileNamesStayOneField) {
  EXPECT_THAT(unreadable_row(0, "a,\"b\"\nc"), StartsWith("0,\"a,\"\"b\"\"?c\",unreadable,"));
}

TEST(FramesCsv, AnOlderFileIsOnlyReplacedByAWholeOne) {
  const testing::TempDir folder;
  const auto path = folder.write("frames.csv", "old");
  {
    auto csv = FramesCsv::create(path);
    ASSERT_TRUE(csv.ok());
    ASSERT_TRUE(csv->write("1").ok());
  }
  EXPECT_EQ(std::filesystem::file_size(path), 3u);
  auto csv = FramesCsv::create(path);
  ASSERT_TRUE(csv.ok());
  ASSERT_TRUE(csv->finish().ok());
  EXPECT_EQ(std::filesystem::file_size(path), kFramesHeader.size() + 1);
  EXPECT_THAT(FramesCsv::create(folder / "none/frames.csv").error().message,
              HasSubstr("none/frames.csv.partial: No such file"));
}

TEST(Summary, StatisticsAreByNearestRank) {
  std::vector<std::int64_t> times;
  for (std::int64_t i = 200; i >= 1; --i) times.push_back(i * 1'000'000);
  const TimeStatistics s = time_statistics(times);
  EXPECT_DOUBLE_EQ(s.mean_ms, 100.5);
  EXPECT_DOUBLE_EQ(s.p50_ms, 100);
  EXPECT_DOUBLE_EQ(s.p95_ms, 190);
  EXPECT_DOUBLE_EQ(s.p99_ms, 198);
  EXPECT_DOUBLE_EQ(s.max_ms, 200);
  EXPECT_DOUBLE_EQ(time_statistics({3'000'000}).p50_ms, 3);
  EXPECT_DOUBLE_EQ(time_statistics({}).max_ms, 0);
}

TEST(Gallery, KeepsTheWidestSpreadAndOneOfLoopsThatLookAlike) {
  Gallery gallery(2);
  gallery.offer(*loop_report(50, 10), "a");
  gallery.offer(*loop_report(55, 30), "a");  // takes the place of 50
  gallery.offer(*loop_report(60, 20), "a");  // like 55, and worse
  EXPECT_EQ(gallery.size(), 1u);
  gallery.offer(*loop_report(80, 5), "a");
  EXPECT_EQ(gallery.size(), 2u);
  gallery.offer(*loop_report(100, 25), "a");  // better than 80
  EXPECT_EQ(gallery.size(), 2u);
  EXPECT_THAT(gallery.queries(), ::testing::ElementsAre(155, 200));
}

TEST(Gallery, TakesOnlyAcceptedLoopsAndNothingWithoutRoom) {
  auto report = loop_report(50, 10);
  Gallery none(0);
  none.offer(*report, "a");
  EXPECT_EQ(none.size(), 0u);
  report->outcome = Outcome::kFewInliers;
  Gallery gallery(2);
  gallery.offer(*report, "a");
  EXPECT_EQ(gallery.size(), 0u);
}

}  // namespace
}  // namespace loopd::loopeval
