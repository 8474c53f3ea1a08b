#include "app/report_queue.h"

#include <gtest/gtest.h>

#include <memory>
#include <thread>

namespace loopd {
namespace {

std::unique_ptr<Report> report_of(ImageId query, Outcome outcome) {
  auto report = std::make_unique<Report>();
  report->query = query;
  report->outcome = outcome;
  return report;
}

TEST(ReportQueue, KeepsThePlacesLeftForLoopsAndDropsTheNewest) {
  ReportQueue queue(4, false);
  const auto give = [&queue](ImageId query, Outcome outcome) {
    return queue.give(*report_of(query, outcome), {});
  };
  for (const ImageId query : {0u, 1u, 2u}) EXPECT_TRUE(give(query, Outcome::kFewInliers));
  EXPECT_FALSE(give(3, Outcome::kFewInliers));
  EXPECT_TRUE(give(4, Outcome::kLoop));
  EXPECT_FALSE(give(5, Outcome::kLoop));
  EXPECT_EQ(queue.dropped(), 2u);
  for (const ImageId query : {0u, 1u, 2u, 4u}) EXPECT_EQ(queue.take()->report.query, query);
  EXPECT_EQ(queue.take(), nullptr);
  EXPECT_TRUE(give(6, Outcome::kFewInliers));
}

TEST(ReportQueue, CarriesAllOfAReportAndItsTimes) {
  ReportQueue queue(4, false);
  const auto report = report_of(9, Outcome::kLoop);
  report->pairs.push_back({1, 2, 3, 4, true});
  report->match = Match{.image = 3, .sequence = 3, .time_ns = 5, .similarity = 0.5};
  queue.give(*report, {70, 60, 2});
  report->clear();
  const auto taken = queue.take();
  ASSERT_NE(taken, nullptr);
  EXPECT_EQ(taken->report.match->image, 3u);
  ASSERT_EQ(taken->report.pairs.size(), 1u);
  EXPECT_EQ(taken->report.pairs[0].match_y_px, 4);
  EXPECT_EQ(taken->origin.taken_ns, 70);
  EXPECT_EQ(taken->origin.captured_ns, 60);
  EXPECT_EQ(taken->origin.map, 2u);
}

TEST(ReportQueue, BlockingLosesNothing) {
  constexpr ImageId kCount = 500;
  ReportQueue queue(4, true);
  std::thread giver([&queue] {
    for (ImageId i = 0; i < kCount; ++i) queue.give(*report_of(i, Outcome::kFewInliers), {});
  });
  for (ImageId i = 0; i < kCount;) {
    if (const auto taken = queue.take())
      ASSERT_EQ(taken->report.query, i++);
    else
      std::this_thread::yield();
  }
  giver.join();
  EXPECT_EQ(queue.dropped(), 0u);
}

TEST(ReportQueue, CloseFreesAGiverThatWaits) {
  ReportQueue queue(1, true);
  queue.give(*report_of(0, Outcome::kLoop), {});
  std::thread giver([&queue] { EXPECT_FALSE(queue.give(*report_of(1, Outcome::kLoop), {})); });
  queue.close();
  giver.join();
  EXPECT_EQ(queue.take()->report.query, 0u);
}

}  // namespace
}  // namespace loopd
