#include <gmock/gmock.h>

#include <random>

#include "events/control_fixture.h"
#include "events/sample_report.h"
#include "events/server_fixture.h"

namespace loopd {
namespace {

using ::testing::HasSubstr;
using testing::TestClient;

class HostileClientTest : public testing::ServerTest {
 protected:
  /// Sends `bytes` and returns the message of the error record that comes.
  std::string complaint(TestClient& client, std::string_view bytes) {
    const std::size_t before = client.count("error");
    EXPECT_TRUE(client.send(bytes));
    EXPECT_TRUE(client.wait_for("error", before + 1));
    return client.of_class("error").back()["message"];
  }
};

TEST_F(HostileClientTest, MistakesAreAnsweredAndTheConnectionStays) {
  start();
  const auto client = connect();
  EXPECT_THAT(complaint(*client, "hello?\n"), HasSubstr("not JSON"));
  EXPECT_THAT(complaint(*client, "{\"op\":\"fly\"}\n"), HasSubstr("unknown op \"fly\""));
  EXPECT_THAT(complaint(*client, "\xff\xfe\xc0\n"), HasSubstr("not JSON"));
  EXPECT_THAT(complaint(*client, std::string_view("{\"op\":\0}\n", 9)), HasSubstr("not JSON"));
  EXPECT_THAT(complaint(*client, std::string(60'000, '[') + "\n"), HasSubstr("nested deeper"));
  EXPECT_THAT(complaint(*client, std::string(100'000, '[') + "\n"), HasSubstr("line longer than"));
  EXPECT_TRUE(client->watch("\"loop\""));
  server_->publish(testing::sample_report());
  EXPECT_TRUE(client->wait_for("loop"));
}

TEST_F(HostileClientTest, TenMegabytesWithoutANewlineAreOneMistake) {
  start();
  const auto client = connect();
  const std::string chunk(100'000, 'x');
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(client->send(chunk));
  ASSERT_TRUE(client->wait_for("error"));
  ASSERT_TRUE(client->send("\n"));
  ASSERT_TRUE(client->watch("\"loop\""));
  EXPECT_EQ(client->count("error"), 1u);
}

TEST_F(HostileClientTest, ALineWithoutEndIsCutOff) {
  start();
  const auto client = connect();
  const std::string chunk(1'000'000, 'x');
  const auto flood = [&] {
    for (int i = 0; i < 40; ++i) {
      if (!client->send(chunk)) return true;
    }
    return false;
  };
  EXPECT_TRUE(flood());
  EXPECT_EQ(server_->clients(), 0u);
  expect_alive();
}

TEST_F(HostileClientTest, RepeatedMistakesEndTheConnection) {
  start();
  const auto client = connect();
  const auto patient = connect();
  for (int i = 0; i < 15; ++i) complaint(*client, "?\n");
  EXPECT_THAT(complaint(*client, "?\n?\n?\n"), HasSubstr("disconnecting"));
  EXPECT_TRUE(loop_.run_until([&] { return client->ended(); }));
  EXPECT_EQ(client->count("error"), 16u);
  EXPECT_EQ(server_->clients(), 1u);
}

TEST_F(HostileClientTest, HalfALineIsToldWhenItCanBe) {
  start();
  const auto client = connect();
  ASSERT_TRUE(client->send("{\"op\":\"wat"));
  client->shut_down_writing();
  ASSERT_TRUE(client->wait_for("error"));
  EXPECT_THAT(client->of_class("error")[0]["message"].get<std::string>(), HasSubstr("no newline"));
  const auto gone = connect();
  ASSERT_TRUE(gone->send("{\"op\":\"wat"));
  gone->close();
  EXPECT_TRUE(loop_.run_until([&] { return server_->clients() == 0; }));
  expect_alive();
}

TEST_F(HostileClientTest, RandomBytesHarmNobody) {
  start();
  const auto watcher = connect_and_watch("\"loop\"");
  std::mt19937 random(7);
  for (int round = 0; round < 50; ++round) {
    TestClient client(loop_, options_.socket_path);
    std::string bytes(1 + random() % 20'000, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random());
    client.send(bytes);
    server_->publish(testing::sample_report());
  }
  EXPECT_TRUE(watcher->wait_for("loop", 50));
  EXPECT_TRUE(loop_.run_until([&] { return server_->clients() == 1; }));
}

TEST_F(HostileClientTest, DamagedRequestsHarmNobody) {
  start();
  const auto watcher = connect_and_watch("\"loop\"");
  const std::string good =
      R"({"op":"watch","classes":["loop","state"],"since":{"epoch":"e1","seq":3},"pairs":true})"
      "\n";
  std::mt19937 random(8);
  for (int round = 0; round < 40; ++round) {
    TestClient client(loop_, options_.socket_path);
    for (int i = 0; i < 20; ++i) {
      std::string bytes = good;
      for (int flips = 0; flips < 3; ++flips) {
        bytes[random() % bytes.size()] = static_cast<char>(random());
      }
      if (!client.send(bytes)) break;
    }
    server_->publish(testing::sample_report());
  }
  EXPECT_TRUE(watcher->wait_for("loop", 40));
  expect_alive();
}

TEST_F(HostileClientTest, ConnectionsThatComeAndGoHarmNobody) {
  start();
  const auto watcher = connect_and_watch("\"loop\"");
  for (int i = 0; i < 500; ++i) {
    { const TestClient client(loop_, options_.socket_path); }
    if (i % 50 == 0) loop_.run_ready();
  }
  server_->publish(testing::sample_report());
  EXPECT_TRUE(watcher->wait_for("loop"));
  EXPECT_TRUE(loop_.run_until([&] { return server_->clients() == 1; }));
}

TEST_F(HostileClientTest, DescriptorsAreNotTaken) {
  options_.seqpacket_path = seqpacket_path(options_.socket_path);
  start();
  const auto lines = connect();
  TestClient packets(loop_, options_.seqpacket_path, SOCK_SEQPACKET);
  ASSERT_TRUE(packets.wait_for("hello"));
  const UniqueFd file = testing::memory_file();
  const std::size_t before = testing::open_descriptors();
  for (int i = 0; i < 50; ++i) {
    const std::vector<int> fds(100, file.get());
    ASSERT_TRUE(testing::send_with(lines->fd(), "{\"op\":\"watch\"}\n", fds));
    ASSERT_TRUE(testing::send_with(packets.fd(), "{\"op\":\"watch\"}", fds));
    ASSERT_TRUE(lines->wait_for("watch", static_cast<std::size_t>(i) + 1));
    ASSERT_TRUE(packets.wait_for("watch", static_cast<std::size_t>(i) + 1));
    EXPECT_EQ(testing::open_descriptors(), before);
  }
}

}  // namespace
}  // namespace loopd
