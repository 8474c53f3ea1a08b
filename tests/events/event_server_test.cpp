#include "events/event_server.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/resource.h>

#include <filesystem>

#include "events/client.h"
#include "events/sample_report.h"
#include "events/server_fixture.h"

namespace loopd {
namespace {

using namespace std::chrono_literals;
using testing::expect_consecutive;
using ::testing::HasSubstr;
using testing::json;
using testing::sample_report;
using testing::TestClient;

class EventServerTest : public testing::ServerTest {};

Report candidate() {
  Report report = sample_report();
  report.outcome = Outcome::kFewInliers;
  return report;
}

TEST_F(EventServerTest, GreetsAndThenSaysNothingUnasked) {
  start();
  const auto client = connect();
  server_->publish(sample_report());
  publish_state();
  server_->publish_stats({});
  ASSERT_TRUE(client->watch("\"loop\""));
  ASSERT_EQ(client->records().size(), 2u);
  EXPECT_EQ(client->records()[0]["class"], "hello");
  EXPECT_EQ(client->records()[0]["camera"], "front");
  EXPECT_EQ(client->records()[0]["seq"], 0);
  EXPECT_EQ(client->records()[1]["class"], "watch");
  EXPECT_EQ(client->records()[1]["seq"], 3);
}

TEST_F(EventServerTest, EachClientGetsItsClassesInOrder) {
  start();
  const auto all = connect_and_watch(R"("loop","candidate","state","stats")");
  const auto some = connect_and_watch(R"("loop","stats")");
  const auto by_default = connect();
  by_default->send("{\"op\":\"watch\"}\r\n");
  ASSERT_TRUE(by_default->wait_for("watch"));
  for (int i = 0; i < 5; ++i) {
    publish_state();
    server_->publish(sample_report());
    server_->publish(candidate());
    server_->publish_stats({});
  }
  Report nothing;
  nothing.outcome = Outcome::kNoCandidates;
  server_->publish(nothing);
  EXPECT_EQ(server_->newest_seq(), 20u) << "a report that is no record takes no seq";
  ASSERT_TRUE(all->wait_for("stats", 5));
  ASSERT_TRUE(some->wait_for("stats", 5));
  ASSERT_TRUE(by_default->wait_for("loop", 5));
  expect_consecutive({all->records().begin() + 2, all->records().end()}, 1);
  EXPECT_EQ(some->records().size(), 2u + 10u);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(some->of_class("loop")[static_cast<std::size_t>(i)]["seq"], 4 * i + 2);
    EXPECT_EQ(by_default->of_class("state")[static_cast<std::size_t>(i)]["seq"], 4 * i + 1);
  }
  EXPECT_EQ(by_default->records().size(), 2u + 10u);
  EXPECT_EQ(all->of_class("stats")[0]["clients"], 3);
}

TEST_F(EventServerTest, PairsAreForThoseWhoAsk) {
  start();
  const auto with = connect_and_watch("\"loop\"", true);
  const auto without = connect_and_watch("\"loop\"", false);
  server_->publish(sample_report());
  ASSERT_TRUE(with->wait_for("loop") && without->wait_for("loop"));
  EXPECT_EQ(with->of_class("loop")[0]["pairs"].size(), 2u);
  EXPECT_FALSE(without->of_class("loop")[0].contains("pairs"));
  EXPECT_TRUE(with->of_class("watch")[0]["pairs"]);
}

TEST_F(EventServerTest, ANewWatchReplacesTheOldOne) {
  start();
  const auto client = connect_and_watch("\"state\"");
  publish_state();
  ASSERT_TRUE(client->wait_for("state"));
  ASSERT_TRUE(client->watch("\"loop\""));
  publish_state();
  server_->publish(sample_report());
  ASSERT_TRUE(client->wait_for("loop"));
  EXPECT_EQ(client->count("state"), 1u);
  // A request that is refused leaves the watch as it was.
  client->send(R"({"op":"watch","classes":["nonsense"]})"
               "\n");
  ASSERT_TRUE(client->wait_for("error"));
  server_->publish(sample_report());
  EXPECT_TRUE(client->wait_for("loop", 2));
}

TEST_F(EventServerTest, LatecomersAreToldTheNewestStateAndStats) {
  start();
  publish_state();
  server_->publish_state({State::kCameraLost, 7, "unplugged", "plug it in"});
  StatsRecord stats;
  stats.frames = 9;
  server_->publish_stats(stats);
  const auto client = connect_and_watch(R"("state","stats")");
  ASSERT_TRUE(client->wait_for("stats"));
  ASSERT_EQ(client->count("state"), 1u);
  const json state = client->of_class("state")[0];
  EXPECT_EQ(state["state"], "camera_lost");
  EXPECT_EQ(state["remedy"], "plug it in");
  EXPECT_EQ(state["seq"], 2);
  EXPECT_EQ(state["repeat"], true);
  EXPECT_EQ(client->of_class("stats")[0]["frames"], 9);
  EXPECT_EQ(client->of_class("stats")[0]["seq"], 3);
}

TEST_F(EventServerTest, ServesSixtyFourAndTurnsTheNextAway) {
  start();
  std::vector<std::unique_ptr<TestClient>> clients;
  for (int i = 0; i < 64; ++i) clients.push_back(connect_and_watch("\"loop\""));
  EXPECT_EQ(server_->clients(), 64u);
  {
    TestClient extra(loop_, options_.socket_path);
    ASSERT_TRUE(extra.wait_for("error"));
    EXPECT_THAT(extra.records()[0]["message"].get<std::string>(),
                HasSubstr("too many clients: 64"));
    EXPECT_TRUE(loop_.run_until([&] { return extra.ended(); }));
  }
  for (int i = 0; i < 20; ++i) server_->publish(sample_report());
  for (const auto& client : clients) {
    ASSERT_TRUE(client->wait_for("loop", 20));
    expect_consecutive(client->of_class("loop"), 1);
  }
  clients.pop_back();
  ASSERT_TRUE(loop_.run_until([&] { return server_->clients() == 63; }));
  EXPECT_TRUE(connect()->wait_for("hello"));
}

/// While it lives this process can open no more descriptors.
class NoMoreDescriptors {
 public:
  NoMoreDescriptors() {
    getrlimit(RLIMIT_NOFILE, &before_);
    const UniqueFd lowest_free(open("/dev/null", O_RDONLY | O_CLOEXEC));
    rlimit now = before_;
    now.rlim_cur = static_cast<rlim_t>(lowest_free.get());
    EXPECT_EQ(setrlimit(RLIMIT_NOFILE, &now), 0);
  }
  ~NoMoreDescriptors() { setrlimit(RLIMIT_NOFILE, &before_); }
  NoMoreDescriptors(const NoMoreDescriptors&) = delete;
  NoMoreDescriptors& operator=(const NoMoreDescriptors&) = delete;

 private:
  rlimit before_{};
};

TEST_F(EventServerTest, OutOfDescriptorsItNeitherSpinsNorGivesUp) {
  start();
  const auto watcher = connect_and_watch("\"loop\"");
  TestClient waiting(loop_, options_.socket_path);
  {
    const NoMoreDescriptors none;
    int busy = 0;
    while (busy < 100 && sd_event_run(loop_.get(), 0) > 0) ++busy;
    EXPECT_LT(busy, 100) << "the connection that cannot be taken wakes the loop without end";
    EXPECT_EQ(server_->clients(), 1u);
    server_->publish(sample_report());
    EXPECT_TRUE(watcher->wait_for("loop"));
  }
  EXPECT_TRUE(waiting.wait_for("hello"));
}

TEST_F(EventServerTest, AClientThatOnlyListensMayCloseItsSide) {
  start();
  const auto client = connect_and_watch("\"loop\"");
  client->shut_down_writing();
  loop_.run_ready();
  server_->publish(sample_report());
  EXPECT_TRUE(client->wait_for("loop"));
  EXPECT_EQ(server_->clients(), 1u);
}

TEST_F(EventServerTest, AClientThatClosesItsSideAndWatchesNothingIsClosed) {
  start();
  const auto client = connect();
  client->shut_down_writing();
  EXPECT_TRUE(loop_.run_until([&] { return client->ended(); }));
  EXPECT_EQ(server_->clients(), 0u);
}

TEST_F(EventServerTest, EndsItsClientsAndItsFile) {
  start();
  const auto client = connect_and_watch("\"state\"");
  server_->publish_state({State::kShuttingDown, 1, "", ""});
  server_.reset();
  ASSERT_TRUE(loop_.run_until([&] { return client->ended(); }));
  EXPECT_EQ(client->of_class("state")[0]["state"], "shutting_down") << "told before the end";
  EXPECT_FALSE(std::filesystem::exists(options_.socket_path));
}

TEST_F(EventServerTest, TellsWhyItCannotListen) {
  start();
  const auto second = EventServer::listen(loop_.get(), options_, {});
  ASSERT_FALSE(second.ok());
  EXPECT_THAT(second.error().message, HasSubstr("a running daemon uses it"));
  loop_.run_ready();
  expect_alive();
  EXPECT_TRUE(loop_.run_until([&] { return server_->clients() == 0; }))
      << "the probe of the second one left no client";
}

// The library's own client, on a server pumped between its reads.

class EventClientTest : public testing::ServerTest {
 protected:
  std::string next(EventClient& client) {
    std::string record;
    EXPECT_TRUE(loop_.run_until([&] {
      Result<std::optional<std::string>> text = client.next(0ms);
      EXPECT_TRUE(text.ok());
      if (!text.ok() || !text.value()) return !text.ok();
      record = *text.value();
      return true;
    }));
    return record;
  }
};

TEST_F(EventClientTest, AsksAndReads) {
  start();
  Result<EventClient> client = EventClient::connect(options_.socket_path);
  ASSERT_TRUE(client.ok()) << client.error().message;
  ASSERT_TRUE(client->watch({{RecordClass::kLoop}, true, std::nullopt}).ok());
  EXPECT_EQ(json::parse(next(*client))["class"], "hello");
  EXPECT_EQ(json::parse(next(*client))["pairs"], true);
  server_->publish(sample_report());
  EXPECT_EQ(next(*client), report_text(sample_report(), {}, {"e1", 1}, true));
  const Result<std::optional<std::string>> nothing = client->next(1ms);
  ASSERT_TRUE(nothing.ok());
  EXPECT_FALSE(nothing.value().has_value());
  server_.reset();
  const Result<std::optional<std::string>> end = client->next(10s);
  ASSERT_FALSE(end.ok());
  EXPECT_THAT(end.error().message, HasSubstr("has closed the connection"));
}

TEST_F(EventClientTest, RefusesRecordsBeyondItsBound) {
  start();
  Result<EventClient> client = EventClient::connect(options_.socket_path, 500);
  ASSERT_TRUE(client.ok());
  ASSERT_TRUE(client->watch({{RecordClass::kState}, false, std::nullopt}).ok());
  next(*client);
  next(*client);
  publish_state(1000);
  const Result<std::optional<std::string>> end = client->next(10s);
  ASSERT_FALSE(end.ok());
  EXPECT_THAT(end.error().message, HasSubstr("longer than allowed"));
}

TEST_F(EventClientTest, NamesThePathWhenThereIsNoDaemon) {
  const Result<EventClient> client = EventClient::connect(options_.socket_path);
  ASSERT_FALSE(client.ok());
  EXPECT_THAT(client.error().message, HasSubstr(options_.socket_path));
  EXPECT_THAT(client.error().message, HasSubstr("is the daemon running"));
}

}  // namespace
}  // namespace loopd
