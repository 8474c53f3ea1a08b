// What is asked of a running daemon: over its control socket, by signals, and by clients that
// return.
#include <fcntl.h>
#include <signal.h>

#include "app/config_file.h"
#include "app/daemon_fixture.h"
#include "events/control_client.h"

namespace loopd {
namespace {

using testing::DaemonTest;
using ::testing::HasSubstr;
using testing::json;
using testing::kPatience;
using testing::LoopSeen;

class DaemonControlTest : public DaemonTest {
 protected:
  ControlClient control() {
    return ControlClient::connect((folder_ / "s.control.sock").string()).value();
  }

  static json asked(ControlClient& client, ControlOp op) {
    auto answer = client.request(op, kPatience);
    EXPECT_TRUE(answer.ok()) << (answer.ok() ? "" : answer.error().message);
    return answer.ok() ? json::parse(answer.value()) : json();
  }
};

TEST_F(DaemonControlTest, PausesAndGoesOn) {
  start(laps(), {"camera.fps=30", "camera.loop=true"}, {"WATCHDOG_USEC=400000"});
  ASSERT_TRUE(notify_.wait_for("READY=1"));
  EventClient events = watcher({RecordClass::kState});
  ASSERT_TRUE(read_until(events, "state", "running"));
  ControlClient client = control();
  asked(client, ControlOp::kPause);
  ASSERT_TRUE(read_until(events, "state", "paused"));
  const json paused = asked(client, ControlOp::kStatus);
  EXPECT_EQ(paused["state"], "paused");
  // No frame is detected any more, and yet this is no hung detector.
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(notify_.wait_for("WATCHDOG=1"));
  asked(client, ControlOp::kResume);
  ASSERT_TRUE(read_until(events, "state", "running"));
  EXPECT_EQ(asked(client, ControlOp::kStatus)["paused"], false);
}

TEST_F(DaemonControlTest, ResetEmptiesTheMapAndBeginsAnEpoch) {
  start(laps(), {"camera.fps=100", "camera.loop=true"});
  ASSERT_TRUE(notify_.wait_for("READY=1"));
  EventClient events = watcher({RecordClass::kLoop, RecordClass::kState});
  const auto before = read_until(events, "class", "loop");
  ASSERT_TRUE(before);
  ControlClient client = control();
  asked(client, ControlOp::kReset);
  const auto hello = read_until(events, "class", "hello");
  ASSERT_TRUE(hello);
  EXPECT_NE((*hello)["epoch"], (*before)["epoch"]);
  const auto reset = read_until(events, "class", "state");
  ASSERT_TRUE(reset);
  EXPECT_EQ((*reset)["state"], "map_reset");
  EXPECT_EQ((*reset)["epoch"], (*hello)["epoch"]);
  ASSERT_TRUE(read_until(events, "state", "running"));
  const auto after = read_until(events, "class", "loop");
  ASSERT_TRUE(after);
  EXPECT_EQ((*after)["epoch"], (*hello)["epoch"]);
}

TEST_F(DaemonControlTest, ReloadTakesOverWhatCanChangeAndNamesTheRest) {
  DaemonConfig config = testing::small_config(laps().string());
  config.camera.fps = 30;
  config.camera.loop = true;
  config.events.socket = socket_;
  config.events.stats_interval_s = 3000;
  const std::string file = (folder_ / "front.toml").string();
  folder_.write("front.toml", config_as_toml(config));
  daemon_.emplace(std::vector<std::string>{LOOPD_PATH, "--config", file},
                  (folder_ / "out").string(), std::vector<std::string>{notify_.environment()});
  ASSERT_TRUE(notify_.wait_for("READY=1"));
  ControlClient client = control();
  config.events.stats_interval_s = 0.05;
  config.detector.verify.min_inliers = 99;
  folder_.write("front.toml", config_as_toml(config));
  EXPECT_EQ(asked(client, ControlOp::kReload)["result"],
            "taken over: events.stats_interval_s; only a restart changes verify.min_inliers");
  folder_.write("front.toml", "[camera]\nfps = -1\n");
  const auto refused = client.request(ControlOp::kReload, kPatience);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr("front.toml:2: camera.fps = -1"));
  daemon_->signal(SIGTERM);
  EXPECT_EQ(daemon_->wait(kPatience), 0);
}

TEST_F(DaemonControlTest, ARecordingPlaysBackToTheSameLoops) {
  const auto images = laps();
  const auto expected = testing::loops_of_detector_alone(testing::small_config(images.string()));
  ASSERT_GE(expected.size(), 5u) << "the sequence proves nothing without loops";
  start(images, {"camera.wait_for_clients=1", "camera.exit_at_end=true"});
  ASSERT_TRUE(notify_.wait_for("READY=1"));
  const std::string file = (folder_ / "walk.lrec").string();
  const UniqueFd recording(open(file.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0600));
  ControlClient client = control();
  ASSERT_TRUE(client.request(ControlOp::kRecord, kPatience, {}, recording.get()).ok());
  const EventClient starter = connected();
  const auto recorded = client.next(kPatience);
  ASSERT_TRUE(recorded.ok() && recorded.value());
  const json told = json::parse(*recorded.value());
  EXPECT_EQ(told["class"], "recorded");
  EXPECT_EQ(told["frames"], 2 * testing::kPlaces);
  EXPECT_EQ(told["lost"], 0);
  EXPECT_EQ(daemon_->wait(kPatience), 0) << errors();

  start(file, {"camera.wait_for_clients=2", "camera.exit_at_end=true"});
  ASSERT_TRUE(notify_.wait_for("READY=1"));
  EventClient events = watcher({RecordClass::kLoop, RecordClass::kState});
  const EventClient second = connected();
  EXPECT_EQ(loops_until_the_end(events), expected);
}

TEST_F(DaemonControlTest, OnlyOneRecordingAtATimeAndItEndsWithWhoBeganIt) {
  start(laps(), {"camera.fps=50", "camera.loop=true"});
  ASSERT_TRUE(notify_.wait_for("READY=1"));
  const auto file_named = [this](const char* name) {
    return UniqueFd(open((folder_ / name).c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600));
  };
  const UniqueFd first_file = file_named("first");
  const UniqueFd second_file = file_named("second");
  ControlClient second = control();
  {
    ControlClient first = control();
    ASSERT_TRUE(first.request(ControlOp::kRecord, kPatience, {}, first_file.get()).ok());
    const auto refused = second.request(ControlOp::kRecord, kPatience, {}, second_file.get());
    ASSERT_FALSE(refused.ok());
    EXPECT_THAT(refused.error().message, HasSubstr("a recording is under way"));
    EXPECT_FALSE(second.request(ControlOp::kStopRecord, kPatience).ok());
    EXPECT_EQ(asked(second, ControlOp::kStatus)["recording"], true);
  }
  while (asked(second, ControlOp::kStatus).contains("recording")) {
  }
  RecordLimits limits;
  limits.seconds = 0.2;
  ASSERT_TRUE(second.request(ControlOp::kRecord, kPatience, limits, second_file.get()).ok());
  const auto recorded = second.next(kPatience);
  ASSERT_TRUE(recorded.ok() && recorded.value());
  EXPECT_EQ(json::parse(*recorded.value())["reason"], "time");
}

TEST_F(DaemonControlTest, WhatAClientMissedOverARestartIsOneGap) {
  const auto images = laps();
  start(images, {"camera.wait_for_clients=1", "camera.exit_at_end=true"});
  ASSERT_TRUE(notify_.wait_for("READY=1"));
  EventClient early = watcher({RecordClass::kLoop, RecordClass::kState});
  const auto seen = read_until(early, "state", "running");
  ASSERT_TRUE(seen);
  std::vector<json> missed;
  ASSERT_TRUE(read_until(early, "state", "shutting_down", &missed));
  EXPECT_EQ(daemon_->wait(kPatience), 0) << errors();

  start(images, {"camera.wait_for_clients=2"});
  ASSERT_TRUE(notify_.wait_for("READY=1"));
  EventClient back = connected();
  ASSERT_TRUE(back.watch({.classes = {RecordClass::kLoop, RecordClass::kState},
                          .pairs = false,
                          .since = Since{(*seen)["epoch"], (*seen)["seq"].get<std::uint64_t>()}})
                  .ok());
  const auto gap = read_until(back, "class", "gap");
  ASSERT_TRUE(gap);
  EXPECT_EQ((*gap)["count"], missed.size());
  std::vector<json> rest;
  const EventClient starter = connected();
  ASSERT_TRUE(read_until(back, "class", "loop", &rest));
  for (const json& record : rest) EXPECT_NE(record["class"], "gap");
}

}  // namespace
}  // namespace loopd
