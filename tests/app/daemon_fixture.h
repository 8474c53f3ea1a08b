#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "app/app_fixture.h"
#include "events/client.h"
#include "support/child_process.h"
#include "support/notify_socket.h"

namespace loopd::testing {

using nlohmann::json;

inline constexpr int kPlaces = 16;
inline constexpr std::chrono::seconds kPatience(60);

/// The daemon as its users meet it: a process with a config, sockets, signals and systemd.
class DaemonTest : public ::testing::Test {
 protected:
  DaemonTest() : socket_((folder_ / "s").string()), notify_((folder_ / "n").string()) {}

  /// Starts the daemon on `images` with small settings and `sets` after them.
  void start(const std::filesystem::path& images, const std::vector<std::string>& sets = {},
             std::vector<std::string> environment = {}) {
    std::vector<std::string> command = {LOOPD_PATH};
    const auto set = [&command](const std::string& text) {
      command.insert(command.end(), {"--set", text});
    };
    for (const auto& [key, value] : small_settings()) set(key + "=" + value);
    set("camera.path=" + images.string());
    set("events.socket=" + socket_);
    for (const std::string& text : sets) set(text);
    environment.push_back(notify_.environment());
    daemon_.emplace(std::move(command), (folder_ / "out").string(), environment);
  }

  /// Runs the daemon with `arguments` alone to its end.
  int run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), LOOPD_PATH);
    daemon_.emplace(std::move(arguments), (folder_ / "out").string());
    return daemon_->wait().value_or(-1);
  }

  std::filesystem::path laps() {
    const TempDir& folder = images_;
    write_laps(folder, kPlaces);
    return folder.path();
  }

  EventClient connected() { return EventClient::connect(socket_).value(); }

  /// A client that watches `classes` for sure: the daemon has said so.
  EventClient watcher(ClassSet classes, bool pairs = false) {
    EventClient client = connected();
    EXPECT_TRUE(client.watch({.classes = classes, .pairs = pairs, .since = {}}).ok());
    EXPECT_TRUE(read_until(client, "class", "watch"));
    return client;
  }

  /// Reads records until one has `value` for `name`; none if the connection ends before.
  static std::optional<json> read_until(EventClient& client, const char* name,
                                        const std::string& value,
                                        std::vector<json>* seen = nullptr) {
    while (true) {
      auto line = client.next(kPatience);
      if (!line || !line.value()) return std::nullopt;
      json record = json::parse(*line.value());
      if (seen != nullptr) seen->push_back(record);
      if (record.value(name, "") == value) return record;
    }
  }

  static std::vector<LoopSeen> loops_until_the_end(EventClient& client) {
    std::vector<json> records;
    EXPECT_TRUE(read_until(client, "state", "shutting_down", &records));
    std::vector<LoopSeen> loops;
    for (const json& record : records) {
      EXPECT_NE(record["class"], "gap");
      if (record["class"] != "loop") continue;
      const json& inliers = record["inliers"];
      loops.push_back({record["query"]["id"].get<ImageId>(), record["match"]["id"].get<ImageId>(),
                       inliers["points"].get<int>() + inliers["lines"].get<int>()});
    }
    return loops;
  }

  std::string errors() const { return daemon_->standard_error(); }

  TempDir folder_;
  TempDir images_;
  std::string socket_;
  NotifySocket notify_;
  std::optional<ChildProcess> daemon_;
};

}  // namespace loopd::testing
