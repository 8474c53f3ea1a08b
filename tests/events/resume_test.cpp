#include <gmock/gmock.h>

#include <random>

#include "events/sample_report.h"
#include "events/server_fixture.h"

namespace loopd {
namespace {

using testing::expect_consecutive;
using ::testing::HasSubstr;
using testing::json;
using testing::sample_report;
using testing::TestClient;

class ResumeTest : public testing::ServerTest {
 protected:
  void publish_states(int n, std::size_t bytes = 100) {
    for (int i = 0; i < n; ++i) publish_state(bytes);
  }
  std::unique_ptr<TestClient> resume(std::string_view classes, const std::string& epoch,
                                     std::uint64_t seq) {
    auto client = connect();
    EXPECT_TRUE(client->watch_since(classes, epoch, seq));
    loop_.run_ready();
    return client;
  }
  static json answer(const TestClient& client) { return client.of_class("watch").back()["since"]; }
};

TEST_F(ResumeTest, SendsWhatWasMissedAndGoesOnLive) {
  start();
  publish_states(10);
  const auto client = resume("\"state\"", "e1", 4);
  publish_states(5);
  ASSERT_TRUE(client->wait_for("state", 11));
  expect_consecutive(client->of_class("state"), 5);
  EXPECT_EQ(client->count("gap"), 0u);
  EXPECT_FALSE(client->of_class("state")[0].contains("repeat"));
  EXPECT_EQ(answer(*client), (json{{"epoch", "e1"}, {"seq", 4}, {"resumed", true}, {"missed", 6}}));
}

TEST_F(ResumeTest, SendsOnlyTheClassesWatched) {
  start();
  for (int i = 0; i < 5; ++i) {
    server_->publish_stats({});
    server_->publish(sample_report());
    publish_state();
  }
  const auto client = resume(R"("loop")", "e1", 3);
  ASSERT_TRUE(client->wait_for("loop", 4));
  EXPECT_EQ(client->records().size(), 2u + 4u);
  EXPECT_EQ(client->of_class("loop")[0]["seq"], 5);
}

TEST_F(ResumeTest, OneThatIsUpToDateMissesNothing) {
  start();
  publish_states(3);
  const auto client = resume(R"("loop","state")", "e1", 3);
  EXPECT_EQ(answer(*client), (json{{"epoch", "e1"}, {"seq", 3}, {"resumed", true}, {"missed", 0}}));
  ASSERT_EQ(client->count("state"), 1u);
  EXPECT_EQ(client->of_class("state")[0]["repeat"], true);
  server_->publish(sample_report());
  EXPECT_TRUE(client->wait_for("loop"));
}

TEST_F(ResumeTest, APlaceInTheFutureIsRefused) {
  start();
  publish_states(3);
  const auto client = resume("\"state\"", "e1", 4);
  EXPECT_EQ(answer(*client)["resumed"], false);
  EXPECT_THAT(answer(*client)["reason"].get<std::string>(), HasSubstr("no such record yet"));
  EXPECT_EQ(client->count("gap"), 0u);
  const auto farthest = resume("\"state\"", "e1", ~0ull);
  EXPECT_EQ(answer(*farthest)["resumed"], false);
  publish_state();
  EXPECT_TRUE(client->wait_for("state", 2) && farthest->wait_for("state", 2));
}

TEST_F(ResumeTest, WhatIsOlderThanTheHistoryIsOneGap) {
  options_.history_records = 10;
  start();
  for (int i = 0; i < 20; ++i) {
    publish_state();
    server_->publish_stats({});
  }
  const auto client = resume("\"state\"", "e1", 5);
  ASSERT_TRUE(client->wait_for("state", 5));
  ASSERT_EQ(client->count("gap"), 1u);
  const json gap = client->of_class("gap")[0];
  EXPECT_EQ(gap["first"], 6);
  EXPECT_EQ(gap["last"], 30);
  EXPECT_EQ(gap["count"], 12) << "states 7, 9, ... 29";
  EXPECT_FALSE(gap.contains("of_epoch"));
  EXPECT_EQ(client->records()[2], gap) << "before what is newer";
  EXPECT_EQ(client->of_class("state")[0]["seq"], 31);
  EXPECT_EQ(answer(*client)["resumed"], false);
  EXPECT_EQ(answer(*client)["missed"], 35);
  // One who watched nothing of what is gone has lost nothing.
  const auto other = resume("\"loop\"", "e1", 5);
  EXPECT_EQ(answer(*other)["resumed"], true);
  EXPECT_EQ(other->count("gap"), 0u);
}

TEST_F(ResumeTest, WithoutAHistoryAllIsOneGap) {
  options_.history_bytes = 0;
  start();
  publish_states(7);
  const auto client = resume("\"state\"", "e1", 2);
  ASSERT_TRUE(client->wait_for("gap"));
  EXPECT_EQ(client->of_class("gap")[0]["count"], 5);
  ASSERT_EQ(client->count("state"), 1u);
  EXPECT_EQ(client->of_class("state")[0]["repeat"], true);
  publish_state();
  ASSERT_TRUE(client->wait_for("state", 2));
  EXPECT_EQ(client->of_class("state")[1]["seq"], 8);
}

TEST_F(ResumeTest, PairsAreNotKept) {
  start();
  const auto live = connect_and_watch("\"loop\"", true);
  server_->publish(sample_report());
  const auto client = connect();
  client->send(R"({"op":"watch","pairs":true,"since":{"epoch":"e1","seq":0}})"
               "\n");
  ASSERT_TRUE(client->wait_for("loop") && live->wait_for("loop"));
  EXPECT_TRUE(live->of_class("loop")[0].contains("pairs"));
  EXPECT_FALSE(client->of_class("loop")[0].contains("pairs"));
  server_->publish(sample_report());
  ASSERT_TRUE(client->wait_for("loop", 2));
  EXPECT_TRUE(client->of_class("loop")[1].contains("pairs"));
}

TEST_F(ResumeTest, AHistoryLargerThanTheQueueComesWholeAndOnce) {
  options_.client_queue_bytes = 8 * 1024;
  options_.history_bytes = 4 * 1024 * 1024;
  start();
  publish_states(1000, 1000);
  const auto client = connect();
  ASSERT_TRUE(client->send(R"({"op":"watch","since":{"epoch":"e1","seq":0}})"
                           "\n"));
  for (int i = 0; i < 200; ++i) {  // live records while the old ones are still under way
    publish_state(1000);
    EXPECT_LE(server_->queued_bytes(), options_.client_queue_bytes + 2000);
    if (i % 3 == 0) sd_event_run(loop_.get(), 0);
  }
  ASSERT_TRUE(client->wait_for("state", 1200));
  expect_consecutive(client->of_class("state"), 1);
  EXPECT_EQ(client->count("gap"), 0u);
  EXPECT_EQ(server_->missed_records(), 0u);
}

TEST_F(ResumeTest, OneThatReadsTheHistoryTooSlowlyIsToldWhatPassed) {
  options_.client_queue_bytes = 8 * 1024;
  options_.history_bytes = 600'000;
  start();
  publish_states(400, 1000);
  const auto client = connect();
  client->stop_reading();
  client->send(R"({"op":"watch","since":{"epoch":"e1","seq":0}})"
               "\n");
  publish_states(2000, 1000);
  client->resume_reading();
  ASSERT_TRUE(loop_.run_until([&] { return client->records().back()["seq"] == 2400; }));
  ASSERT_EQ(client->count("gap"), 1u);
  const json gap = client->of_class("gap")[0];
  const std::vector<json> states = client->of_class("state");
  EXPECT_EQ(states.size() + gap["count"].get<std::size_t>(), 2400u);
  const std::uint64_t before = gap["first"].get<std::uint64_t>() - 1;
  expect_consecutive({states.begin(), states.begin() + static_cast<std::ptrdiff_t>(before)}, 1);
  expect_consecutive({states.begin() + static_cast<std::ptrdiff_t>(before), states.end()},
                     gap["last"].get<std::uint64_t>() + 1);
  EXPECT_EQ(server_->missed_records(), gap["count"]);
}

TEST_F(ResumeTest, OneThatNeverReadsTheHistoryIsDisconnected) {
  options_.client_queue_bytes = 8 * 1024;
  options_.stalled_client = std::chrono::milliseconds(50);
  start();
  publish_states(900, 1000);
  const auto client = connect();
  client->stop_reading();
  client->send(R"({"op":"watch","since":{"epoch":"e1","seq":0}})"
               "\n");
  EXPECT_TRUE(loop_.run_until([&] { return server_->clients() == 0; }));
}

TEST_F(ResumeTest, ANewWatchOnTheWayLosesNothing) {
  options_.client_queue_bytes = 8 * 1024;
  start();
  for (int i = 0; i < 500; ++i) {
    publish_state(1000);
    server_->publish(sample_report());
  }
  const auto client = connect();
  client->stop_reading();
  client->send(R"({"op":"watch","classes":["loop","state"],"since":{"epoch":"e1","seq":0}})"
               "\n"
               R"({"op":"watch","classes":["loop"]})"
               "\n");
  client->resume_reading();
  ASSERT_TRUE(client->wait_for("loop", 500));
  const std::vector<json> loops = client->of_class("loop");
  for (std::size_t i = 0; i < loops.size(); ++i) EXPECT_EQ(loops[i]["seq"], 2 * i + 2);
}

TEST_F(ResumeTest, RandomComingsAndGoingsLoseAndDoubleNothing) {
  options_.history_bytes = 100'000;
  options_.client_queue_bytes = 20'000;
  start();
  std::mt19937 random(11);
  std::uint64_t seen = 0, counted = 0;
  for (int round = 0; round < 60; ++round) {
    publish_states(static_cast<int>(random() % 200), 300);
    const auto client = resume("\"state\"", "e1", seen);
    publish_states(static_cast<int>(random() % 50), 300);
    ASSERT_TRUE(
        loop_.run_until([&] { return client->records().back()["seq"] == server_->newest_seq(); }));
    for (const json& record : client->records()) {
      if (record.contains("repeat")) continue;
      if (record["class"] == "gap") {
        ASSERT_EQ(record["first"], seen + 1);
        seen = record["last"];
        counted += record["count"].get<std::uint64_t>();
      } else if (record["class"] == "state") {
        ASSERT_EQ(record["seq"], seen + 1);
        ++seen;
        ++counted;
      }
    }
    ASSERT_EQ(counted, server_->newest_seq());
  }
}

// A new epoch at run time.

TEST_F(ResumeTest, ANewEpochIsToldToAllAndSeqGoesOn) {
  start();
  const auto watching = connect_and_watch(R"("state","loop")");
  const auto idle = connect();
  publish_states(2);
  server_->new_epoch("e2");
  server_->publish_state({State::kMapReset, 1, "", "", {}});
  ASSERT_TRUE(watching->wait_for("state", 3) && idle->wait_for("hello", 2));
  const std::vector<json>& records = watching->records();
  EXPECT_EQ(records[3]["epoch"], "e1");
  EXPECT_EQ(records[4]["class"], "hello");
  EXPECT_EQ(records[4]["epoch"], "e2");
  EXPECT_EQ(records[4]["seq"], 2);
  EXPECT_EQ(records[5]["state"], "map_reset");
  EXPECT_EQ(records[5]["epoch"], "e2");
  EXPECT_EQ(records[5]["seq"], 3);
  EXPECT_EQ(connect()->records()[0]["epoch"], "e2");
}

TEST_F(ResumeTest, WhatWasMissedOfAnOlderEpochIsOneGap) {
  start();
  publish_states(5);
  server_->publish_stats({});
  server_->new_epoch("e2");
  publish_states(3);
  const auto client = resume("\"state\"", "e1", 2);
  ASSERT_TRUE(client->wait_for("state", 3));
  ASSERT_EQ(client->count("gap"), 1u);
  const json gap = client->of_class("gap")[0];
  EXPECT_EQ(gap["epoch"], "e2");
  EXPECT_EQ(gap["of_epoch"], "e1");
  EXPECT_EQ(gap["first"], 3);
  EXPECT_EQ(gap["last"], 6);
  EXPECT_EQ(gap["count"], 3);
  EXPECT_EQ(client->records()[2], gap);
  expect_consecutive(client->of_class("state"), 7);
  EXPECT_EQ(answer(*client)["resumed"], false);
  EXPECT_EQ(answer(*client)["missed"], 7);
}

TEST_F(ResumeTest, OneThatSawAllOfTheOlderEpochMissesNothing) {
  start();
  publish_states(5);
  server_->new_epoch("e2");
  publish_states(3);
  const auto client = resume("\"state\"", "e1", 5);
  ASSERT_TRUE(client->wait_for("state", 3));
  EXPECT_EQ(client->count("gap"), 0u);
  EXPECT_EQ(answer(*client)["resumed"], true);
  EXPECT_EQ(answer(*client)["missed"], 3);
}

TEST_F(ResumeTest, SeveralOlderEpochsAreCountedInOneGap) {
  start();
  publish_states(5);
  server_->new_epoch("e2");
  publish_states(4);
  server_->new_epoch("e3");
  publish_state();
  const json gap = resume("\"state\"", "e1", 3)->of_class("gap").at(0);
  EXPECT_EQ(gap["count"], 2 + 4);
  EXPECT_EQ(gap["last"], 5);
  const json between = resume("\"state\"", "e1", 5)->of_class("gap").at(0);
  EXPECT_EQ(between["count"], 4);
  EXPECT_FALSE(between.contains("first")) << "none of them is of e1";
}

TEST_F(ResumeTest, AnUnknownEpochIsAGapWithoutCount) {
  start();
  publish_states(3);
  const auto client = resume("\"state\"", "never", 2);
  ASSERT_TRUE(client->wait_for("state", 3));
  ASSERT_EQ(client->count("gap"), 1u);
  for (const char* key : {"count", "first", "last", "of_epoch"}) {
    EXPECT_FALSE(client->of_class("gap")[0].contains(key)) << key;
  }
  expect_consecutive(client->of_class("state"), 1);
  EXPECT_EQ(answer(*client)["resumed"], false);
  EXPECT_FALSE(answer(*client).contains("missed"));
  // Nor is a record that the known epoch never had believed.
  server_->new_epoch("e2");
  EXPECT_FALSE(resume("\"state\"", "e1", 4)->of_class("gap").at(0).contains("count"));
}

TEST_F(ResumeTest, SlowReadersAreToldTheirGapBeforeTheNewEpoch) {
  start();
  const auto client = connect_and_watch("\"state\"");
  client->stop_reading();
  publish_states(2000, 1000);
  ASSERT_GT(server_->missed_records(), 0u);
  const std::uint64_t missed = server_->missed_records();
  server_->new_epoch("e2");
  client->resume_reading();
  ASSERT_TRUE(client->wait_for("hello", 2));
  const std::vector<json>& records = client->records();
  EXPECT_EQ(records.back()["class"], "hello");
  const json& gap = records[records.size() - 2];
  EXPECT_EQ(gap["class"], "gap");
  EXPECT_EQ(gap["epoch"], "e1");
  EXPECT_EQ(gap["last"], 2000);
  EXPECT_EQ(gap["count"], missed);
}

TEST_F(ResumeTest, ANewEpochDuringAReplayIsAGapForTheRest) {
  options_.client_queue_bytes = 8 * 1024;
  start();
  publish_states(600, 1000);
  const auto client = connect();
  client->stop_reading();
  client->send(R"({"op":"watch","since":{"epoch":"e1","seq":0}})"
               "\n");
  server_->new_epoch("e2");
  publish_state();
  client->resume_reading();
  ASSERT_TRUE(loop_.run_until([&] { return client->records().back()["seq"] == 601; }));
  const std::size_t states = client->count("state") - 1;
  const json gap = client->of_class("gap").at(0);
  EXPECT_EQ(client->count("gap"), 1u);
  EXPECT_EQ(gap["epoch"], "e1");
  EXPECT_EQ(gap["first"], states + 1);
  EXPECT_EQ(gap["last"], 600);
  EXPECT_EQ(gap["count"], 600 - states);
}

TEST_F(ResumeTest, EpochsInPlentyDoNotPileUpForOneThatNeverReads) {
  options_.client_queue_bytes = 8 * 1024;
  start();
  const auto client = connect_and_watch("\"state\"");
  client->stop_reading();
  std::size_t most = 0;
  for (int i = 0; i < 5000 && server_->clients() == 1; ++i) {
    server_->new_epoch("e" + std::to_string(i));
    publish_state(100);
    most = std::max(most, server_->queued_bytes());
  }
  EXPECT_EQ(server_->clients(), 0u);
  EXPECT_LE(most, 3 * options_.client_queue_bytes);
}

}  // namespace
}  // namespace loopd
