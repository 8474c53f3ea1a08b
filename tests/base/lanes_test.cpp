#include "base/lanes.h"

#include <gtest/gtest.h>
#include <pthread.h>

#include <future>

#include <stdexcept>
#include <string>
#include <thread>

namespace loopd {
namespace {

std::unique_ptr<TwoLanes> two_lanes() { return TwoLanes::start({.name = "lines"}).value(); }

TEST(TwoLanes, RunsPointsHereAndLinesInTheNamedThread) {
  const auto lanes = two_lanes();
  std::thread::id points;
  std::thread::id lines;
  std::string name(16, '\0');
  lanes->run([&] { points = std::this_thread::get_id(); },
             [&] {
               lines = std::this_thread::get_id();
               pthread_getname_np(pthread_self(), name.data(), name.size());
             });
  EXPECT_EQ(points, std::this_thread::get_id());
  EXPECT_NE(lines, points);
  EXPECT_STREQ(name.c_str(), "lines");
}

TEST(TwoLanes, RunsEachHalfExactlyOnceAndBothBeforeItReturns) {
  const auto lanes = two_lanes();
  int points = 0;  // plain: run() itself orders the two threads
  int lines = 0;
  for (int i = 1; i <= 5000; ++i) {
    lanes->run([&] { ++points; }, [&] { ++lines; });
    ASSERT_EQ(points, i);
    ASSERT_EQ(lines, i);
  }
}

TEST(TwoLanes, HalvesRunAtTheSameTime) {
  const auto lanes = two_lanes();
  std::promise<void> from_points;
  std::promise<void> from_lines;
  // Each half waits for the other: this returns only if both are under way together.
  lanes->run(
      [&] {
        from_points.set_value();
        from_lines.get_future().wait();
      },
      [&] {
        from_lines.set_value();
        from_points.get_future().wait();
      });
}

TEST(TwoLanes, CarriesTheExceptionOfEitherHalfOver) {
  const auto lanes = two_lanes();
  bool lines_done = false;
  EXPECT_THROW(lanes->run([] { throw std::runtime_error("points"); }, [&] { lines_done = true; }),
               std::runtime_error);
  EXPECT_TRUE(lines_done);
  bool points_done = false;
  EXPECT_THROW(lanes->run([&] { points_done = true; }, [] { throw std::out_of_range("lines"); }),
               std::out_of_range);
  EXPECT_TRUE(points_done);
  EXPECT_THROW(lanes->run([] { throw std::runtime_error("points"); },
                          [] { throw std::out_of_range("lines"); }),
               std::runtime_error);
  lanes->run([] {}, [] {});  // nothing is left over from the failures
}

}  // namespace
}  // namespace loopd
