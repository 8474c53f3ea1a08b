#include "events/control_client.h"

#include <gmock/gmock.h>
#include <sys/eventfd.h>

#include <atomic>
#include <functional>
#include <thread>

#include "events/control_fixture.h"

namespace loopd {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using testing::json;
using testing::memory_file;

/// The blocking client in a thread of its own; this one runs the server meanwhile.
class ControlClientTest : public testing::ControlTest {
 protected:
  void run(const std::function<void()>& client) {
    std::atomic<bool> done = false;
    std::thread thread([&] {
      client();
      done = true;
    });
    EXPECT_TRUE(loop_.run_until([&] { return done.load(); }));
    thread.join();
  }
};

TEST_F(ControlClientTest, AsksAndIsAnswered) {
  start();
  reply_.fields = {{"state", std::string("running")}};
  run([&] {
    Result<ControlClient> client = ControlClient::connect(options_.socket_path);
    ASSERT_TRUE(client.ok()) << client.error().message;
    for (int i = 0; i < 3; ++i) {
      const Result<std::string> answer = client->request(ControlOp::kStatus, 10s);
      ASSERT_TRUE(answer.ok()) << answer.error().message;
      EXPECT_EQ(json::parse(answer.value())["state"], "running");
    }
  });
}

TEST_F(ControlClientTest, ARefusalIsAnError) {
  start();
  reply_ = ControlReply::refusal("it cannot be done now");
  run([&] {
    Result<ControlClient> client = ControlClient::connect(options_.socket_path);
    ASSERT_TRUE(client.ok());
    const Result<std::string> answer = client->request(ControlOp::kReset, 10s);
    ASSERT_FALSE(answer.ok());
    EXPECT_EQ(answer.error().message, "it cannot be done now");
  });
}

TEST_F(ControlClientTest, RecordsIntoItsOwnFileAndWaitsForTheEnd) {
  ControlActions actions{[this](ControlRequest request) {
                           if (request.op == ControlOp::kRecord) {
                             EXPECT_EQ(write(request.file.get(), "frame", 5), 5);
                             // Comes before the answer: the client keeps it for next().
                             server_->send(request.client, "recorded", {});
                           }
                           return ControlReply{};
                         },
                         [](std::uint64_t) {}};
  auto server = ControlServer::listen(loop_.get(), options_, std::move(actions));
  ASSERT_TRUE(server.ok());
  server_ = std::move(server).value();
  run([&] {
    const UniqueFd file = memory_file();
    Result<ControlClient> client = ControlClient::connect(options_.socket_path);
    ASSERT_TRUE(client.ok());
    const auto answer = client->request(ControlOp::kRecord, 10s, {1, 1024 * 1024}, file.get());
    ASSERT_TRUE(answer.ok()) << answer.error().message;
    const auto later = client->next(10s);
    ASSERT_TRUE(later.ok() && later.value());
    EXPECT_EQ(json::parse(*later.value())["class"], "recorded");
    std::array<char, 6> read{};
    EXPECT_EQ(pread(file.get(), read.data(), 5, 0), 5);
    EXPECT_STREQ(read.data(), "frame");
    EXPECT_TRUE(client->request(ControlOp::kStatus, 10s).ok());
  });
}

TEST_F(ControlClientTest, ADeadlineOrAWakeUpEndsTheWait) {
  start();
  run([&] {
    Result<ControlClient> client = ControlClient::connect(options_.socket_path);
    ASSERT_TRUE(client.ok());
    const auto nothing = client->next(5ms);
    ASSERT_TRUE(nothing.ok());
    EXPECT_FALSE(nothing.value());
    const UniqueFd wake(eventfd(1, EFD_CLOEXEC));
    const auto woken = client->next(std::chrono::hours(1), wake.get());
    ASSERT_TRUE(woken.ok());
    EXPECT_FALSE(woken.value());
  });
}

TEST_F(ControlClientTest, ADaemonThatDoesNotAnswerIsNamed) {
  start();  // and its loop does not run
  Result<ControlClient> client = ControlClient::connect(options_.socket_path);
  ASSERT_TRUE(client.ok());
  const Result<std::string> answer = client->request(ControlOp::kPause, 5ms);
  ASSERT_FALSE(answer.ok());
  EXPECT_EQ(answer.error().code, ETIMEDOUT);
  EXPECT_THAT(answer.error().message, HasSubstr("has not answered \"pause\""));
}

TEST_F(ControlClientTest, OneTooManyIsToldWhy) {
  options_.max_clients = 0;
  start();
  run([&] {
    Result<ControlClient> client = ControlClient::connect(options_.socket_path);
    ASSERT_TRUE(client.ok());
    const auto answer = client->request(ControlOp::kStatus, 10s);
    ASSERT_FALSE(answer.ok());
    EXPECT_THAT(answer.error().message, HasSubstr("too many clients"));
  });
}

TEST_F(ControlClientTest, TheEndOfTheDaemonIsAnError) {
  start();
  Result<ControlClient> client = ControlClient::connect(options_.socket_path);
  ASSERT_TRUE(client.ok());
  server_.reset();
  const auto answer = client->request(ControlOp::kStatus, 10s);
  ASSERT_FALSE(answer.ok());
  EXPECT_THAT(answer.error().message, HasSubstr(options_.socket_path));
}

TEST_F(ControlClientTest, NamesThePathWhenThereIsNoDaemon) {
  const auto client = ControlClient::connect(options_.socket_path);
  ASSERT_FALSE(client.ok());
  EXPECT_THAT(client.error().message, HasSubstr("is the daemon running"));
}

}  // namespace
}  // namespace loopd
