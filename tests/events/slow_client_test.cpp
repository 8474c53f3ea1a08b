#include "events/sample_report.h"
#include "events/server_fixture.h"

namespace loopd {
namespace {

using testing::expect_consecutive;
using testing::json;
using testing::TestClient;

class SlowClientTest : public testing::ServerTest {
 protected:
  /// Publishes state records of about 1 KB, letting the loop run after each.
  void publish_many(int n) {
    for (int i = 0; i < n; ++i) {
      publish_state(1000);
      loop_.run_ready();
    }
  }
};

TEST_F(SlowClientTest, GetsOneGapWithTheExactCountAndCostsOthersNothing) {
  start();
  const auto slow = connect_and_watch("\"state\"");
  std::vector<std::unique_ptr<TestClient>> others;
  for (int i = 0; i < 3; ++i) others.push_back(connect_and_watch("\"state\""));
  slow->stop_reading();

  constexpr std::size_t kPublished = 2000;
  publish_many(kPublished);
  for (const auto& other : others) {
    ASSERT_TRUE(other->wait_for("state", kPublished));
    expect_consecutive(other->of_class("state"), 1);
    EXPECT_EQ(other->count("gap"), 0u);
  }
  EXPECT_GT(server_->queued_bytes(), options_.client_queue_bytes / 2);
  EXPECT_LE(server_->queued_bytes(), options_.client_queue_bytes);
  EXPECT_GT(server_->missed_records(), 0u);

  slow->resume_reading();
  ASSERT_TRUE(slow->wait_for("gap"));
  ASSERT_TRUE(loop_.run_until([&] { return server_->queued_bytes() == 0; }));
  publish_many(3);
  ASSERT_TRUE(loop_.run_until([&] { return slow->records().back()["seq"] == kPublished + 3; }));

  // hello, watch, an unbroken run, the gap, an unbroken run.
  ASSERT_EQ(slow->count("gap"), 1u);
  const json gap = slow->of_class("gap")[0];
  const std::vector<json> states = slow->of_class("state");
  const std::size_t before = states.size() - 3;
  EXPECT_EQ(slow->records()[2 + before], gap);
  expect_consecutive({states.begin(), states.begin() + static_cast<std::ptrdiff_t>(before)}, 1);
  expect_consecutive({states.end() - 3, states.end()}, kPublished + 1);
  EXPECT_EQ(gap["count"], kPublished - before);
  EXPECT_EQ(gap["first"], before + 1);
  EXPECT_EQ(gap["last"], kPublished);
  EXPECT_EQ(gap["count"], server_->missed_records());
}

TEST_F(SlowClientTest, TheGapCountsOnlyWhatItWatches) {
  options_.client_queue_bytes = 4096;
  start();
  const auto slow = connect_and_watch("\"state\"");
  slow->stop_reading();
  for (int i = 0; i < 1000; ++i) {
    publish_state(1000);
    server_->publish_stats({});
  }
  slow->resume_reading();
  ASSERT_TRUE(slow->wait_for("gap"));
  ASSERT_TRUE(loop_.run_until([&] { return server_->queued_bytes() == 0; }));
  loop_.run_ready();
  EXPECT_EQ(slow->count("state") + slow->of_class("gap")[0]["count"].get<std::size_t>(), 1000u);
}

TEST_F(SlowClientTest, ARecordLongerThanTheQueueStillArrives) {
  options_.client_queue_bytes = 1000;
  start();
  const auto client = connect_and_watch("\"state\"");
  publish_state(3'000'000);  // longer than the kernel's buffer too
  ASSERT_TRUE(client->wait_for("state"));
  EXPECT_EQ(client->of_class("state")[0]["cause"].get<std::string>().size(), 3'000'000u);
}

TEST_F(SlowClientTest, OneThatReadsNothingIsDisconnectedInTheEnd) {
  options_.client_queue_bytes = 10'000;
  options_.stalled_client = std::chrono::milliseconds(50);
  start();
  const auto stalled = connect_and_watch("\"state\"");
  const auto idle = connect_and_watch("\"loop\"");
  stalled->stop_reading();
  publish_many(500);
  ASSERT_GT(server_->missed_records(), 0u);
  EXPECT_TRUE(loop_.run_until([&] { return server_->clients() == 1; }));
  EXPECT_EQ(server_->queued_bytes(), 0u);
  server_->publish(testing::sample_report());
  EXPECT_TRUE(idle->wait_for("loop")) << "one with nothing to read is not stalled";
}

TEST_F(SlowClientTest, OneThatLeavesWithAFullQueueHarmsNobody) {
  start();
  auto leaving = connect_and_watch("\"state\"");
  const auto other = connect_and_watch("\"state\"");
  leaving->stop_reading();
  publish_many(1000);
  leaving->close();
  publish_state();  // into a closed connection: SIGPIPE would end this test
  publish_state();
  ASSERT_TRUE(other->wait_for("state", 1002));
  EXPECT_EQ(server_->clients(), 1u);
  expect_consecutive(other->of_class("state"), 1);
}

TEST_F(SlowClientTest, OneThatAsksAndNeverReadsIsBoundedToo) {
  options_.stalled_client = std::chrono::milliseconds(200);
  start();
  publish_state(10'000);  // repeated in every answer
  const auto asking = connect();
  asking->stop_reading();
  std::string requests;
  for (int i = 0; i < 1000; ++i) requests += "{\"op\":\"watch\"}\n";
  std::size_t most = 0;
  const bool ended = loop_.run_until([&] {
    asking->try_send(requests);
    most = std::max(most, server_->queued_bytes());
    return server_->clients() == 0;
  });
  EXPECT_TRUE(ended);
  EXPECT_GT(most, options_.client_queue_bytes / 2);
  EXPECT_LE(most, options_.client_queue_bytes + 20'000) << "the bound and one answer";
  expect_alive();
}

}  // namespace
}  // namespace loopd
