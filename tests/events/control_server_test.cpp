#include "events/control_server.h"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <random>

#include "events/control_fixture.h"

namespace loopd {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::json;
using testing::memory_file;
using testing::open_descriptors;
using testing::send_with;
using testing::TestClient;

class ControlServerTest : public testing::ControlTest {
 protected:
  static std::string message(const json& answer) {
    EXPECT_EQ(answer["class"], "error");
    return answer.value("message", "");
  }
};

TEST_F(ControlServerTest, IsForOwnerAndGroupOnly) {
  start();
  struct stat file;
  ASSERT_EQ(stat(options_.socket_path.c_str(), &file), 0);
  EXPECT_EQ(file.st_mode & 0777u, 0660u);
}

TEST_F(ControlServerTest, AnswersWhatTheDaemonSays) {
  start();
  const auto client = connect();
  reply_.fields = {{"state", std::string("running")}, {"frames", std::int64_t{7}}};
  EXPECT_EQ(ask(*client, R"({"op":"status"})"),
            (json{{"class", "ok"}, {"op", "status"}, {"state", "running"}, {"frames", 7}}));
  reply_ = ControlReply::refusal("it is paused already");
  EXPECT_EQ(ask(*client, R"({"op":"pause"})"),
            (json{{"class", "error"}, {"op", "pause"}, {"message", "it is paused already"}}));
  ASSERT_EQ(requests_.size(), 2u);
  EXPECT_EQ(requests_[0].op, ControlOp::kStatus);
  EXPECT_EQ(requests_[1].op, ControlOp::kPause);
  EXPECT_EQ(requests_[0].pid, getpid());
  EXPECT_EQ(requests_[0].uid, getuid());
  EXPECT_FALSE(requests_[0].file.valid());
}

TEST_F(ControlServerTest, GivesARecordingItsFile) {
  start();
  const auto client = connect();
  const UniqueFd file = memory_file();
  const json answer =
      ask_with(*client, R"({"op":"record","seconds":5,"max_mib":10})", {file.get()});
  EXPECT_EQ(answer, (json{{"class", "ok"}, {"op", "record"}}));
  ASSERT_EQ(requests_.size(), 1u);
  EXPECT_EQ(requests_[0].limits.seconds, 5);
  EXPECT_EQ(requests_[0].limits.max_bytes, 10u * 1024 * 1024);
  ASSERT_EQ(write(requests_[0].file.get(), "frame", 5), 5);
  EXPECT_NE(fcntl(requests_[0].file.get(), F_GETFD) & FD_CLOEXEC, 0);
  std::array<char, 6> read{};
  EXPECT_EQ(pread(file.get(), read.data(), 5, 0), 5);
  EXPECT_STREQ(read.data(), "frame");
}

TEST_F(ControlServerTest, TellsLaterWhatWasRecorded) {
  start();
  const auto client = connect();
  const auto other = connect();
  ask_with(*client, R"({"op":"record"})", {memory_file().get()});
  ask(*other, R"({"op":"status"})");
  ASSERT_TRUE(server_->send(requests_[0].client, "recorded", {{"frames", std::int64_t{3}}}));
  ASSERT_TRUE(client->wait_for("recorded"));
  EXPECT_EQ(client->of_class("recorded")[0], (json{{"class", "recorded"}, {"frames", 3}}));
  EXPECT_EQ(other->count("recorded"), 0u);
}

TEST_F(ControlServerTest, TellsTheDaemonWhoHasLeft) {
  start();
  auto client = connect();
  const auto other = connect();
  ask_with(*client, R"({"op":"record"})", {memory_file().get()});
  ask(*other, R"({"op":"status"})");
  client->close();
  ASSERT_TRUE(loop_.run_until([&] { return !gone_.empty(); }));
  EXPECT_THAT(gone_, ElementsAre(requests_[0].client));
  EXPECT_NE(requests_[0].client, requests_[1].client);
  EXPECT_FALSE(server_->send(requests_[0].client, "recorded", {})) << "nobody to tell";
  EXPECT_TRUE(server_->send(requests_[1].client, "recorded", {}));
}

TEST_F(ControlServerTest, OneThatOnlyListensIsKeptForAsLongAsThereIsNews) {
  start();
  const auto recording = connect();
  ask_with(*recording, R"({"op":"record"})", {memory_file().get()});
  recording->shut_down_writing();
  const auto asking = connect();
  ask(*asking, R"({"op":"status"})");
  asking->shut_down_writing();
  ASSERT_TRUE(loop_.run_until([&] { return asking->ended(); }));
  EXPECT_FALSE(recording->ended());
  server_->send(requests_[0].client, "recorded", {});
  EXPECT_TRUE(recording->wait_for("recorded"));
}

TEST_F(ControlServerTest, AnswersAfterTheClientHasClosedItsSide) {
  start();
  const auto client = connect();
  client->send("{\"op\":\"status\"}\n{\"op\":\"pause\"}\n");
  client->shut_down_writing();
  ASSERT_TRUE(loop_.run_until([&] { return client->ended(); }));
  EXPECT_EQ(client->count("ok"), 2u);
}

TEST_F(ControlServerTest, ADaemonMayTellNewsBeforeItsAnswer) {
  ControlActions actions{[this](ControlRequest request) {
                           server_->send(request.client, "recorded", {});
                           return ControlReply{};
                         },
                         [this](std::uint64_t client) { server_->send(client, "recorded", {}); }};
  auto server = ControlServer::listen(loop_.get(), options_, std::move(actions));
  ASSERT_TRUE(server.ok());
  server_ = std::move(server).value();
  auto client = connect();
  EXPECT_EQ(ask(*client, R"({"op":"stop_record"})")["class"], "recorded");
  EXPECT_TRUE(client->wait_for("ok"));
  client->close();
  EXPECT_TRUE(loop_.run_until([&] { return server_->clients() == 0; }));
}

TEST_F(ControlServerTest, RefusesWhatIsNoRecordingFile) {
  start();
  const auto client = connect();
  const auto record_to = [&](int fd) {
    return message(ask_with(*client, R"({"op":"record"})", {fd}));
  };
  const std::string path = dir_.write("file", "x");
  const auto opened = [&](int flags) { return UniqueFd(open(path.c_str(), flags)); };
  EXPECT_THAT(message(ask(*client, R"({"op":"record"})")), HasSubstr("must be passed along"));
  EXPECT_THAT(record_to(opened(O_RDONLY).get()), HasSubstr("not open for writing"));
  EXPECT_THAT(record_to(opened(O_PATH).get()), HasSubstr("not open for writing"));
  EXPECT_THAT(record_to(opened(O_WRONLY | O_APPEND).get()), HasSubstr("for appending"));
  EXPECT_THAT(record_to(UniqueFd(open("/dev/null", O_RDWR)).get()), HasSubstr("no regular file"));
  EXPECT_THAT(record_to(UniqueFd(open(dir_.path().c_str(), O_RDONLY)).get()),
              HasSubstr("no regular file"));
  EXPECT_THAT(record_to(client->fd()), HasSubstr("no regular file"));
  EXPECT_TRUE(requests_.empty());
  EXPECT_EQ(ask_with(*client, R"({"op":"record"})", {opened(O_WRONLY).get()})["class"], "ok");
}

TEST_F(ControlServerTest, TakesExactlyOneDescriptor) {
  start();
  const auto client = connect();
  const UniqueFd file = memory_file();
  for (const std::size_t n : {2u, 3u, 100u}) {
    const std::vector<int> fds(n, file.get());
    EXPECT_THAT(message(ask_with(*client, R"({"op":"record"})", fds)), HasSubstr("exactly one"));
  }
  // Nor one that came with something else.
  ask_with(*client, R"({"op":"status"})", {file.get()});
  EXPECT_THAT(message(ask(*client, R"({"op":"record"})")), HasSubstr("must be passed along"));
  ask_with(*client, "nonsense", {file.get()});
  EXPECT_THAT(message(ask(*client, R"({"op":"record"})")), HasSubstr("must be passed along"));
}

TEST_F(ControlServerTest, ADescriptorFindsItsRequestAmongSeveral) {
  start();
  const auto client = connect();
  ASSERT_TRUE(client->try_send("{\"op\":\"status\"}\n{\"op\":"));
  ASSERT_TRUE(send_with(client->fd(), "\"record\"}\n", {memory_file().get()}));
  ASSERT_TRUE(client->wait_for("ok", 2));
  EXPECT_FALSE(requests_[0].file.valid());
  EXPECT_TRUE(requests_[1].file.valid());
  // And one that came with the first part of a line waits for the rest.
  ASSERT_TRUE(send_with(client->fd(), "{\"op\":", {memory_file().get()}));
  loop_.run_ready();
  ASSERT_TRUE(client->try_send("\"record\"}\n"));
  ASSERT_TRUE(client->wait_for("ok", 3));
  EXPECT_TRUE(requests_[2].file.valid());
}

TEST_F(ControlServerTest, FloodsOfDescriptorsLeaveNoneOpen) {
  start();
  const auto client = connect();
  ask(*client, R"({"op":"status"})");
  const UniqueFd file = memory_file();
  const std::size_t before = open_descriptors();
  const std::vector<int> many(200, file.get());
  const std::vector<std::string> lines = {R"({"op":"status"})", R"({"op":"record"})",
                                          R"({"op":"record","seconds":0})"};
  std::mt19937 random(3);
  for (int i = 0; i < 300; ++i) {
    const std::vector<int> fds(many.begin(), many.begin() + 1 + random() % many.size());
    TestClient flooding(loop_, options_.socket_path);
    ask_with(flooding, lines[i % lines.size()], fds);
    requests_.clear();
  }
  // Parts of lines, each with descriptors, and their end never comes.
  for (int i = 0; i < 100; ++i) {
    send_with(client->fd(), "x", many);
    loop_.run_ready();
    EXPECT_LE(open_descriptors(), before + 9) << "one waits at most";
  }
  ASSERT_TRUE(client->send("\n"));
  ASSERT_TRUE(client->wait_for("error"));
  EXPECT_TRUE(loop_.run_until([&] { return server_->clients() == 1; }));
  EXPECT_EQ(open_descriptors(), before);
}

TEST_F(ControlServerTest, ClientsThatLeaveTakeTheirDescriptorsAlong) {
  start();
  const std::size_t before = open_descriptors();
  for (int i = 0; i < 50; ++i) {
    const UniqueFd file = memory_file();
    TestClient client(loop_, options_.socket_path);
    send_with(client.fd(), "{\"op\":", {file.get()});
    if (i % 2 == 0) loop_.run_ready();
  }
  EXPECT_TRUE(loop_.run_until([&] { return server_->clients() == 0; }));
  loop_.run_ready();
  EXPECT_EQ(open_descriptors(), before);
}

TEST_F(ControlServerTest, MistakesAreAnsweredAndThenEnd) {
  start();
  const auto client = connect();
  EXPECT_EQ(ask(*client, R"({"op":"record","seconds":-1})")["op"], "record");
  EXPECT_THAT(message(ask(*client, "?")), HasSubstr("not JSON"));
  EXPECT_THAT(message(ask(*client, R"({"op":"fly"})")), HasSubstr("unknown op"));
  EXPECT_THAT(message(ask(*client, std::string(4097, 'x'))), HasSubstr("line longer than 4096"));
  EXPECT_THAT(message(ask(*client, std::string(3000, '['))), HasSubstr("nested deeper"));
  for (int i = 5; i < 15; ++i) ask(*client, "?");
  EXPECT_THAT(message(ask(*client, "?")), HasSubstr("disconnecting"));
  EXPECT_TRUE(loop_.run_until([&] { return client->ended(); }));
  EXPECT_TRUE(requests_.empty());
}

TEST_F(ControlServerTest, RandomAndDamagedRequestsHarmNobody) {
  start();
  const auto patient = connect();
  std::mt19937 random(4);
  const std::string good = "{\"op\":\"record\",\"seconds\":1.5,\"max_mib\":12}\n";
  for (int round = 0; round < 100; ++round) {
    TestClient client(loop_, options_.socket_path);
    for (int i = 0; i < 20; ++i) {
      std::string bytes = good;
      for (int flips = 0; flips < 3; ++flips) {
        bytes[random() % bytes.size()] = static_cast<char>(random());
      }
      if (!client.send(bytes)) break;
    }
  }
  EXPECT_EQ(ask(*patient, R"({"op":"status"})")["class"], "ok");
}

TEST_F(ControlServerTest, ServesFew) {
  start();
  std::vector<std::unique_ptr<TestClient>> clients;
  for (int i = 0; i < 8; ++i) {
    clients.push_back(connect());
    ask(*clients.back(), R"({"op":"status"})");
  }
  TestClient extra(loop_, options_.socket_path);
  ASSERT_TRUE(extra.wait_for("error"));
  EXPECT_THAT(message(extra.records()[0]), HasSubstr("too many clients: 8"));
  EXPECT_TRUE(gone_.empty()) << "it was never there";
}

TEST_F(ControlServerTest, OneThatAsksAndNeverReadsIsDisconnected) {
  options_.client_queue_bytes = 4096;
  options_.stalled_client = std::chrono::milliseconds(50);
  reply_.fields = {{"text", std::string(1000, 'x')}};
  start();
  const auto asking = connect();
  asking->stop_reading();
  std::string requests;
  for (int i = 0; i < 200; ++i) requests += "{\"op\":\"status\"}\n";
  std::size_t most = 0;
  EXPECT_TRUE(loop_.run_until([&] {
    asking->try_send(requests);
    most = std::max(most, server_->queued_bytes());
    return !gone_.empty();
  }));
  EXPECT_LE(most, options_.client_queue_bytes + 2000);
}

TEST_F(ControlServerTest, TakesOverAnInheritedSocket) {
  const sockaddr_un address = unix_address(options_.socket_path).value();
  std::vector<UniqueFd> fds;
  fds.emplace_back(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  ASSERT_EQ(bind(fds[0].get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  ASSERT_EQ(listen(fds[0].get(), 8), 0);
  InheritedSockets inherited(std::move(fds));
  start(&inherited);
  const auto client = connect();
  EXPECT_EQ(ask(*client, R"({"op":"status"})")["class"], "ok");
  server_.reset();
  EXPECT_TRUE(std::filesystem::exists(options_.socket_path));
}

TEST_F(ControlServerTest, TellsWhyItCannotListen) {
  start();
  const auto second = ControlServer::listen(loop_.get(), options_, {});
  ASSERT_FALSE(second.ok());
  EXPECT_THAT(second.error().message, HasSubstr("a running daemon uses it"));
}

}  // namespace
}  // namespace loopd
