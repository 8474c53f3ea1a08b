#include <fcntl.h>
#include <gmock/gmock.h>

#include "events/sample_report.h"
#include "events/server_fixture.h"

namespace loopd {
namespace {

using testing::expect_consecutive;
using ::testing::HasSubstr;
using testing::json;
using testing::TestClient;

/// A service manager that keeps the listening sockets while daemons come and go.
class RestartTest : public testing::ServerTest {
 protected:
  RestartTest() {
    options_.seqpacket_path = seqpacket_path(options_.socket_path);
    options_.ledger_path = (dir_ / "ledger").string();
    kept_.push_back(listen_on(options_.socket_path, SOCK_STREAM));
    kept_.push_back(listen_on(options_.seqpacket_path, SOCK_SEQPACKET));
  }

  static UniqueFd listen_on(const std::string& path, int type) {
    const sockaddr_un address = unix_address(path).value();
    UniqueFd fd(socket(AF_UNIX, type | SOCK_CLOEXEC, 0));
    EXPECT_EQ(bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    EXPECT_EQ(listen(fd.get(), 16), 0);
    return fd;
  }

  void start_daemon(const std::string& epoch) {
    std::vector<UniqueFd> fds;
    for (const UniqueFd& fd : kept_) fds.emplace_back(fcntl(fd.get(), F_DUPFD_CLOEXEC, 3));
    InheritedSockets inherited(std::move(fds));
    start(epoch, &inherited);
    EXPECT_TRUE(inherited.left().empty());
    EXPECT_EQ(server_->warning(), "");
  }

  std::vector<UniqueFd> kept_;
};

TEST_F(RestartTest, ClientsThatConnectInBetweenWait) {
  start_daemon("e1");
  server_.reset();
  EXPECT_TRUE(std::filesystem::exists(options_.socket_path));
  EXPECT_TRUE(std::filesystem::exists(options_.seqpacket_path));
  TestClient early(loop_, options_.socket_path);
  TestClient early_packets(loop_, options_.seqpacket_path, SOCK_SEQPACKET);
  early.send("{\"op\":\"watch\",\"since\":{\"epoch\":\"e1\",\"seq\":0}}\n");
  start_daemon("e2");
  EXPECT_TRUE(early.wait_for("watch"));
  EXPECT_TRUE(early_packets.wait_for("hello"));
  EXPECT_EQ(early.records()[0]["epoch"], "e2");
}

TEST_F(RestartTest, WhatWasMissedIsOneGapWithTheExactCount) {
  start_daemon("e1");
  for (int i = 0; i < 10; ++i) {
    publish_state();
    server_->publish_stats({});
  }
  server_.reset();
  start_daemon("e2");
  for (int i = 0; i < 3; ++i) publish_state();
  for (const auto& [path, type] : {std::pair(options_.socket_path, SOCK_STREAM),
                                   std::pair(options_.seqpacket_path, SOCK_SEQPACKET)}) {
    TestClient client(loop_, path, type);
    ASSERT_TRUE(client.watch_since("\"state\"", "e1", 4));
    ASSERT_TRUE(client.wait_for("state", 3));
    ASSERT_EQ(client.count("gap"), 1u);
    const json gap = client.of_class("gap")[0];
    EXPECT_EQ(gap["of_epoch"], "e1");
    EXPECT_EQ(gap["first"], 5);
    EXPECT_EQ(gap["last"], 20);
    EXPECT_EQ(gap["count"], 8);
    expect_consecutive(client.of_class("state"), 1);
    EXPECT_EQ(client.of_class("watch")[0]["since"]["missed"], 16 + 3);
  }
}

TEST_F(RestartTest, SeveralRestartsAreCountedTogether) {
  for (const char* epoch : {"e1", "e2", "e3"}) {
    start_daemon(epoch);
    for (int i = 0; i < 5; ++i) publish_state();
    server_.reset();
  }
  start_daemon("e4");
  TestClient client(loop_, options_.socket_path);
  ASSERT_TRUE(client.watch_since("\"state\"", "e1", 4));
  ASSERT_TRUE(client.wait_for("gap"));
  EXPECT_EQ(client.of_class("gap")[0]["count"], 1 + 5 + 5);
  EXPECT_EQ(client.count("state"), 0u) << "the old daemon's state is no news";
}

TEST_F(RestartTest, WithoutALedgerNobodyPretendsToKnow) {
  options_.ledger_path.clear();
  start_daemon("e1");
  publish_state();
  server_.reset();
  start_daemon("e2");
  TestClient client(loop_, options_.socket_path);
  ASSERT_TRUE(client.watch_since("\"state\"", "e1", 1));
  ASSERT_TRUE(client.wait_for("gap"));
  EXPECT_FALSE(client.of_class("gap")[0].contains("count"));
  EXPECT_EQ(client.of_class("watch")[0]["since"]["resumed"], false);
}

TEST_F(RestartTest, ALedgerThatCannotBeMadeIsAWarning) {
  options_.ledger_path = (dir_ / "no/ledger").string();
  options_.socket_path = (dir_ / "own.sock").string();
  options_.seqpacket_path.clear();
  start();
  EXPECT_THAT(server_->warning(), HasSubstr("no/ledger"));
  expect_alive();
}

TEST_F(RestartTest, AnInheritedSocketThatDoesNotFitIsAnError) {
  std::vector<UniqueFd> fds;
  fds.push_back(std::move(kept_[1]));
  InheritedSockets inherited(std::move(fds));
  options_.socket_path = options_.seqpacket_path;
  const auto server = EventServer::listen(loop_.get(), options_, {}, &inherited);
  ASSERT_FALSE(server.ok());
  EXPECT_THAT(server.error().message, HasSubstr("ListenStream="));
}

}  // namespace
}  // namespace loopd
