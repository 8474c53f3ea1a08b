#pragma once

#include <gtest/gtest.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <systemd/sd-event.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <functional>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "base/unique_fd.h"
#include "events/event_server.h"
#include "events/listening_socket.h"
#include "support/temp_dir.h"

namespace loopd::testing {

using nlohmann::json;

/// The test's own sd-event loop: server and clients live in it, in one thread.
class Loop {
 public:
  Loop() { EXPECT_GE(sd_event_new(&loop_), 0); }
  ~Loop() { sd_event_unref(loop_); }
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  sd_event* get() const { return loop_; }

  /// Handles events until `condition` holds; false if it does not within half a minute.
  bool run_until(const std::function<bool()>& condition) const {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (!condition()) {
      if (std::chrono::steady_clock::now() > deadline) return false;
      if (sd_event_run(loop_, 10'000) < 0) return false;
    }
    return true;
  }

  /// Handles all that is ready now.
  void run_ready() const {
    while (sd_event_run(loop_, 0) > 0) {
    }
  }

 private:
  sd_event* loop_ = nullptr;
};

/// How many descriptors this process has open.
inline std::size_t open_descriptors() {
  const std::filesystem::directory_iterator fds("/proc/self/fd");
  return static_cast<std::size_t>(std::distance(begin(fds), end(fds)));
}

/// A client that reads whenever something comes (or is told not to) and keeps it. On a packet
/// socket (SOCK_SEQPACKET) each packet is one record, and each send() is one packet.
class TestClient {
 public:
  TestClient(const Loop& loop, const std::string& path, int type = SOCK_STREAM)
      : loop_(loop), packets_(type == SOCK_SEQPACKET) {
    fd_.reset(socket(AF_UNIX, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    const sockaddr_un address = unix_address(path).value();
    const auto* generic = reinterpret_cast<const sockaddr*>(&address);
    EXPECT_EQ(connect(fd_.get(), generic, sizeof(address)), 0) << errno;
    EXPECT_GE(sd_event_add_io(loop.get(), &source_, fd_.get(), EPOLLIN, on_readable, this), 0);
  }
  ~TestClient() { close(); }
  TestClient(const TestClient&) = delete;
  TestClient& operator=(const TestClient&) = delete;

  /// Sends all of `bytes`, running the loop while the server has yet to read; false if the
  /// connection ended.
  bool send(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t n = ::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (n > 0) {
        bytes.remove_prefix(static_cast<std::size_t>(n));
      } else if (errno != EAGAIN) {
        return false;
      }
      loop_.run_ready();
    }
    return true;
  }
  /// One non-blocking send; false if the connection ended or the server does not read.
  bool try_send(std::string_view bytes) const {
    return ::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT) > 0;
  }
  void stop_reading() { sd_event_source_set_enabled(source_, SD_EVENT_OFF); }
  void resume_reading() { sd_event_source_set_enabled(source_, SD_EVENT_ON); }
  void shut_down_writing() const { shutdown(fd_.get(), SHUT_WR); }
  void close() {
    source_ = sd_event_source_disable_unref(source_);
    fd_.reset();
  }

  int fd() const { return fd_.get(); }
  bool ended() const { return ended_; }
  /// All complete records so far.
  const std::vector<json>& records() const { return records_; }
  std::size_t count(std::string_view record_class) const { return of_class(record_class).size(); }
  std::vector<json> of_class(std::string_view record_class) const {
    std::vector<json> found;
    for (const json& record : records_) {
      if (record["class"] == record_class) found.push_back(record);
    }
    return found;
  }

  /// Runs the loop until `n` records of the class are here.
  bool wait_for(std::string_view record_class, std::size_t n = 1) {
    return loop_.run_until([&] { return count(record_class) >= n || ended_; }) &&
           count(record_class) >= n;
  }
  bool watch(std::string_view classes, bool pairs = false) {
    return ask_to_watch(classes, pairs ? R"("pairs":true)" : R"("pairs":false)");
  }
  bool watch_since(std::string_view classes, const std::string& epoch, std::uint64_t seq) {
    return ask_to_watch(
        classes, R"("since":{"epoch":")" + epoch + R"(","seq":)" + std::to_string(seq) + "}");
  }

 private:
  static int on_readable(sd_event_source*, int, std::uint32_t, void* self) {
    static_cast<TestClient*>(self)->receive();
    return 0;
  }
  bool ask_to_watch(std::string_view classes, const std::string& more) {
    const std::size_t before = count("watch");
    send(R"({"op":"watch","classes":[)" + std::string(classes) + "]," + more +
         (packets_ ? "}" : "}\n"));
    return wait_for("watch", before + 1);
  }

  void receive() {
    std::vector<char> bytes(std::max<std::size_t>(65536, waiting_packet_bytes()));
    const ssize_t n = recv(fd_.get(), bytes.data(), bytes.size(), 0);
    if (n < 0 && errno == EAGAIN) return;
    if (n <= 0) {
      ended_ = true;
      stop_reading();
      return;
    }
    if (packets_) {
      records_.push_back(json::parse(std::string_view(bytes.data(), static_cast<std::size_t>(n))));
      return;
    }
    text_.append(bytes.data(), static_cast<std::size_t>(n));
    std::size_t start = 0;
    for (std::size_t end; (end = text_.find('\n', start)) != std::string::npos; start = end + 1) {
      records_.push_back(json::parse(text_.substr(start, end - start)));
    }
    text_.erase(0, start);
  }

  std::size_t waiting_packet_bytes() const {
    const ssize_t n = packets_ ? recv(fd_.get(), nullptr, 0, MSG_PEEK | MSG_TRUNC) : 0;
    return n > 0 ? static_cast<std::size_t>(n) : 0;
  }

  const Loop& loop_;
  const bool packets_;
  UniqueFd fd_;
  sd_event_source* source_ = nullptr;
  std::string text_;
  std::vector<json> records_;
  bool ended_ = false;
};

/// A server on a socket of its own.
class ServerTest : public ::testing::Test {
 protected:
  ServerTest() { options_.socket_path = (dir_ / "events.sock").string(); }

  void start(const std::string& epoch = "e1", InheritedSockets* inherited = nullptr) {
    Result<std::unique_ptr<EventServer>> server = EventServer::listen(
        loop_.get(), options_, {"0.1.0", "front", epoch, "b1", "monotonic"}, inherited);
    ASSERT_TRUE(server.ok()) << server.error().message;
    server_ = std::move(server).value();
  }

  std::unique_ptr<TestClient> connect() {
    auto client = std::make_unique<TestClient>(loop_, options_.socket_path);
    EXPECT_TRUE(client->wait_for("hello"));
    return client;
  }
  std::unique_ptr<TestClient> connect_and_watch(std::string_view classes, bool pairs = false) {
    auto client = connect();
    EXPECT_TRUE(client->watch(classes, pairs));
    return client;
  }

  /// A state record of about `bytes` bytes.
  void publish_state(std::size_t bytes = 0) {
    server_->publish_state({State::kRunning, 1, std::string(bytes, 'x'), ""});
  }

  /// Whether the server still does its work: a new client is greeted and told of a new record.
  void expect_alive() {
    const auto client = connect_and_watch(R"("stats")");
    const std::size_t before = client->count("stats");
    server_->publish_stats({});
    EXPECT_TRUE(client->wait_for("stats", before + 1));
  }

  TempDir dir_;
  Loop loop_;
  ServerOptions options_;
  std::unique_ptr<EventServer> server_;
};

/// Whether the seq of `records` grow by one each.
inline void expect_consecutive(const std::vector<json>& records, std::uint64_t first) {
  for (const json& record : records) {
    ASSERT_EQ(record["seq"], first) << record;
    ++first;
  }
}

}  // namespace loopd::testing
