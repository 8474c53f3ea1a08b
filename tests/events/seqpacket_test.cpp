#include <gmock/gmock.h>

#include <fstream>
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

class SeqpacketTest : public testing::ServerTest {
 protected:
  SeqpacketTest() { options_.seqpacket_path = seqpacket_path(options_.socket_path); }

  std::unique_ptr<TestClient> connect_packets() {
    auto client = std::make_unique<TestClient>(loop_, options_.seqpacket_path, SOCK_SEQPACKET);
    EXPECT_TRUE(client->wait_for("hello"));
    return client;
  }
  std::unique_ptr<TestClient> watch_packets(std::string_view classes, bool pairs = false) {
    auto client = connect_packets();
    EXPECT_TRUE(client->watch(classes, pairs));
    return client;
  }
  std::string complaint(TestClient& client, std::string_view packet) {
    const std::size_t before = client.count("error");
    EXPECT_TRUE(client.send(packet));
    EXPECT_TRUE(client.wait_for("error", before + 1));
    return client.of_class("error").back()["message"];
  }
};

Report with_pairs(std::size_t n) {
  Report report = sample_report();
  while (report.pairs.size() < n) {
    report.pairs.push_back({1234.5677f, 2345.6789f, 345.67891f, 1456.7891f, false});
  }
  return report;
}

/// Larger than the kernel lets any packet of ours be.
std::size_t too_many_bytes() {
  std::size_t wmem_max = 0;
  std::ifstream("/proc/sys/net/core/wmem_max") >> wmem_max;
  return 2 * wmem_max + 1000;
}

TEST_F(SeqpacketTest, GivesTheSameRecordsAsTheStream) {
  start();
  const auto lines = connect_and_watch(R"("loop","state","stats")", true);
  const auto packets = watch_packets(R"("loop","state","stats")", true);
  for (int i = 0; i < 20; ++i) {
    server_->publish(sample_report());
    publish_state(1000);
    server_->publish_stats({});
  }
  ASSERT_TRUE(lines->wait_for("stats", 20) && packets->wait_for("stats", 20));
  EXPECT_EQ(lines->records(), packets->records());
  EXPECT_EQ(server_->clients(), 2u);
}

TEST_F(SeqpacketTest, HasNoNewlineInItsPackets) {
  start();
  const sockaddr_un address = unix_address(options_.seqpacket_path).value();
  const UniqueFd fd(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0));
  ASSERT_EQ(::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  loop_.run_ready();
  std::array<char, 4096> bytes;
  const ssize_t n = recv(fd.get(), bytes.data(), bytes.size(), 0);
  ASSERT_GT(n, 0);
  EXPECT_EQ(bytes[0], '{');
  EXPECT_EQ(bytes[static_cast<std::size_t>(n) - 1], '}');
}

TEST_F(SeqpacketTest, ARequestIsOnePacketWithOrWithoutNewlines) {
  start();
  const auto client = connect_packets();
  for (const char* packet : {"{\"op\":\"watch\"}", "{\"op\":\"watch\"}\n", "{\"op\":\"watch\"}\r\n",
                             "{\n\"op\":\n\"watch\"\n}\n\n"}) {
    const std::size_t before = client->count("watch");
    ASSERT_TRUE(client->send(packet));
    EXPECT_TRUE(client->wait_for("watch", before + 1)) << packet;
  }
  EXPECT_THAT(complaint(*client, "{\"op\":\"watch\"}\n{\"op\":\"watch\"}\n"), HasSubstr("not JSON"))
      << "two in one packet are no request";
}

TEST_F(SeqpacketTest, CarriesALongRecordInOnePacket) {
  start();
  const auto client = watch_packets("\"loop\"", true);
  const Report report = with_pairs(Report::kMaxPairs);
  server_->publish(report);
  ASSERT_TRUE(client->wait_for("loop"));
  EXPECT_EQ(client->of_class("loop")[0]["pairs"].size(), report.pairs.size());
}

TEST_F(SeqpacketTest, EnlargesItsBufferForARecordThatNeedsIt) {
  start();
  const auto client = watch_packets("\"state\"");
  publish_state(300'000);  // beyond the 208 KiB that the kernel gives by default
  ASSERT_TRUE(client->wait_for("state"));
  EXPECT_EQ(client->of_class("state")[0]["cause"].get<std::string>().size(), 300'000u);
}

TEST_F(SeqpacketTest, ARecordThatNoPacketCanHoldIsAGapInItsPlace) {
  start();
  const auto packets = watch_packets("\"state\"");
  const auto lines = connect_and_watch("\"state\"");
  publish_state();
  publish_state(too_many_bytes());
  ASSERT_TRUE(lines->wait_for("state", 2)) << "a stream has no such bound";
  publish_state();
  ASSERT_TRUE(packets->wait_for("state", 2));
  const std::vector<json>& records = packets->records();
  ASSERT_EQ(records.size(), 5u);
  EXPECT_EQ(records[2]["seq"], 1);
  EXPECT_EQ(records[3]["class"], "gap");
  EXPECT_EQ(records[3]["first"], 2);
  EXPECT_EQ(records[3]["last"], 2);
  EXPECT_EQ(records[3]["count"], 1);
  EXPECT_EQ(records[4]["seq"], 3);
  EXPECT_EQ(server_->missed_records(), 1u);
}

TEST_F(SeqpacketTest, ALatecomerIsToldThatTheNewestStateIsTooLarge) {
  start();
  publish_state(too_many_bytes());
  const auto client = watch_packets("\"state\"");
  ASSERT_TRUE(client->wait_for("gap"));
  publish_state();
  EXPECT_TRUE(client->wait_for("state"));
}

TEST_F(SeqpacketTest, ASlowReaderGetsOneGap) {
  start();
  const auto slow = watch_packets("\"state\"");
  slow->stop_reading();
  for (int i = 0; i < 2000; ++i) publish_state(1000);
  ASSERT_GT(server_->missed_records(), 0u);
  EXPECT_LE(server_->queued_bytes(), options_.client_queue_bytes);
  slow->resume_reading();
  ASSERT_TRUE(slow->wait_for("gap"));
  ASSERT_TRUE(loop_.run_until([&] { return server_->queued_bytes() == 0; }));
  publish_state();
  ASSERT_TRUE(loop_.run_until([&] { return slow->records().back()["seq"] == 2001; }));
  ASSERT_EQ(slow->count("gap"), 1u);
  EXPECT_EQ(slow->count("state") - 1 + slow->of_class("gap")[0]["count"].get<std::size_t>(), 2000u);
}

TEST_F(SeqpacketTest, OneThatReadsNothingIsDisconnectedInTheEnd) {
  options_.client_queue_bytes = 10'000;
  options_.stalled_client = std::chrono::milliseconds(50);
  start();
  const auto stalled = watch_packets("\"state\"");
  stalled->stop_reading();
  for (int i = 0; i < 500; ++i) publish_state(1000);
  EXPECT_TRUE(loop_.run_until([&] { return server_->clients() == 0; }));
}

TEST_F(SeqpacketTest, MistakesAreAnsweredAndTheConnectionStays) {
  start();
  const auto client = connect_packets();
  EXPECT_THAT(complaint(*client, "hello?"), HasSubstr("not JSON"));
  EXPECT_THAT(complaint(*client, std::string_view("\0\n\0", 3)), HasSubstr("not JSON"));
  EXPECT_THAT(complaint(*client, std::string(60'000, '[')), HasSubstr("nested deeper"));
  EXPECT_THAT(complaint(*client, std::string(64 * 1024 + 1, 'x')), HasSubstr("packet longer than"));
  EXPECT_THAT(complaint(*client, std::string(150'000, 'x')), HasSubstr("packet longer than"));
  EXPECT_THAT(complaint(*client, std::string(64 * 1024, 'x')), HasSubstr("not JSON"));
  EXPECT_TRUE(client->watch("\"loop\""));
}

TEST_F(SeqpacketTest, AnEmptyPacketEndsTheRequests) {
  start();
  const auto watching = watch_packets("\"loop\"");
  const auto idle = connect_packets();
  for (const auto& client : {watching.get(), idle.get()}) {
    ASSERT_EQ(::send(client->fd(), "", 0, MSG_NOSIGNAL), 0);
  }
  EXPECT_TRUE(loop_.run_until([&] { return idle->ended(); }));
  server_->publish(sample_report());
  EXPECT_TRUE(watching->wait_for("loop"));
}

TEST_F(SeqpacketTest, RandomPacketsHarmNobody) {
  start();
  const auto watcher = watch_packets("\"loop\"");
  std::mt19937 random(9);
  for (int round = 0; round < 50; ++round) {
    TestClient client(loop_, options_.seqpacket_path, SOCK_SEQPACKET);
    for (int i = 0; i < 20; ++i) {
      std::string bytes(1 + random() % 2000, '\0');
      for (char& byte : bytes) byte = static_cast<char>(random());
      if (!client.send(bytes)) break;
    }
    server_->publish(sample_report());
  }
  EXPECT_TRUE(watcher->wait_for("loop", 50));
  EXPECT_TRUE(loop_.run_until([&] { return server_->clients() == 1; }));
}

TEST_F(SeqpacketTest, BothSocketsShareTheNumberOfClients) {
  options_.max_clients = 2;
  start();
  const auto lines = connect();
  const auto packets = connect_packets();
  TestClient extra(loop_, options_.seqpacket_path, SOCK_SEQPACKET);
  ASSERT_TRUE(extra.wait_for("error"));
  EXPECT_THAT(extra.records()[0]["message"].get<std::string>(), HasSubstr("too many clients: 2"));
}

TEST_F(SeqpacketTest, ResumesLikeTheStream) {
  start();
  for (int i = 0; i < 900; ++i) publish_state(1000);
  const auto client = connect_packets();
  ASSERT_TRUE(client->watch_since("\"state\"", "e1", 10));
  ASSERT_TRUE(client->wait_for("state", 890));
  expect_consecutive(client->of_class("state"), 11);
}

TEST_F(SeqpacketTest, ItsFileGoesWithTheServer) {
  start();
  EXPECT_TRUE(std::filesystem::exists(options_.seqpacket_path));
  server_.reset();
  EXPECT_TRUE(std::filesystem::is_empty(dir_.path()));
}

}  // namespace
}  // namespace loopd
