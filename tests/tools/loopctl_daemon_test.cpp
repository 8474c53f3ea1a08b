// loopctl and a real daemon on recorded images.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "app/app_fixture.h"
#include "app/config_file.h"
#include "events/client.h"
#include "tools/loopctl_process.h"

namespace loopd {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using testing::ChildProcess;
using ::testing::HasSubstr;
using testing::LoopctlResult;
using ::testing::Not;
using testing::TempDir;

constexpr std::chrono::seconds kPatience(60);
constexpr int kPlaces = 6;

class LoopctlDaemonTest : public ::testing::Test {
 protected:
  LoopctlDaemonTest() {
    testing::write_laps(images_, kPlaces);
    config_ = testing::small_config(images_.string());
    config_.camera.fps = 60;
    config_.camera.loop = true;
    config_.events.socket = (folder_ / "events.sock").string();
    config_.events.stats_interval_s = 0.05;
    config_file_ = (folder_ / "front.toml").string();
  }

  /// Starts the daemon, and waits until it says that it runs.
  void start() {
    folder_.write("front.toml", config_as_toml(config_));
    daemon_.emplace(std::vector<std::string>{LOOPD_PATH, "--config", config_file_},
                    (folder_ / "daemon").string());
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    while (!watch_until("running") && std::chrono::steady_clock::now() < deadline &&
           !daemon_->wait(std::chrono::milliseconds(10))) {
    }
    ASSERT_FALSE(daemon_->wait(std::chrono::milliseconds(0))) << daemon_->standard_error();
  }

  /// Whether the daemon tells the state `name`, now or soon.
  bool watch_until(const std::string& name) {
    Result<EventClient> client = EventClient::connect(config_.events.socket);
    if (!client || !client->watch({{RecordClass::kState}, false, std::nullopt})) return false;
    while (true) {
      const auto text = client->next(kPatience);
      if (!text || !text.value()) return false;
      if (json::parse(*text.value()).value("state", "") == name) return true;
    }
  }

  LoopctlResult control(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--control", (folder_ / "control.sock").string()});
    return testing::run_loopctl(folder_, std::move(arguments));
  }
  LoopctlResult status() {
    return testing::run_loopctl(folder_, {"status", "--socket", config_.events.socket});
  }
  /// Without systemd, whatever this machine runs.
  LoopctlResult doctor(std::vector<std::string> more = {}) {
    const TempDir no_programs;
    std::vector<std::string> arguments = {"doctor", "--config", config_file_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return testing::run_loopctl(folder_, std::move(arguments), {"PATH=" + no_programs.string()});
  }

  TempDir folder_;
  TempDir images_;
  DaemonConfig config_;
  std::string config_file_;
  std::optional<ChildProcess> daemon_;
};

TEST_F(LoopctlDaemonTest, PausesResumesAndResets) {
  start();
  const LoopctlResult paused = control({"pause"});
  EXPECT_EQ(paused.exit_code, 0) << paused.err;
  EXPECT_TRUE(watch_until("paused"));
  EXPECT_THAT(status().out, HasSubstr("camera front: paused\n"));
  EXPECT_EQ(control({"resume"}).exit_code, 0);
  EXPECT_TRUE(watch_until("running"));
  const auto epoch = [this] {
    const auto result =
        testing::run_loopctl(folder_, {"status", "--json", "--socket", config_.events.socket});
    return json::parse(result.out)["hello"]["epoch"].get<std::string>();
  };
  const std::string before = epoch();
  EXPECT_EQ(control({"reset"}).exit_code, 0);
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (epoch() == before && std::chrono::steady_clock::now() < deadline) {
  }
  EXPECT_NE(epoch(), before);
}

TEST_F(LoopctlDaemonTest, ReloadSaysWhatCameOfIt) {
  start();
  config_.events.stats_interval_s = 0.1;
  folder_.write("front.toml", config_as_toml(config_));
  const LoopctlResult reloaded = control({"reload"});
  EXPECT_EQ(reloaded.exit_code, 0) << reloaded.err;
  EXPECT_THAT(reloaded.out, HasSubstr("events.stats_interval_s"));
  folder_.write("front.toml", "[camera]\nwidht = 3\n");
  const LoopctlResult refused = control({"reload"});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("widht"));
}

TEST_F(LoopctlDaemonTest, ARecordingIsAFileThatPlays) {
  start();
  const std::string file = (folder_ / "a.rec").string();
  const LoopctlResult recorded = control({"record", file, "--max-mib", "1"});
  EXPECT_EQ(recorded.exit_code, 0) << recorded.err << recorded.out;
  EXPECT_THAT(recorded.out, AllOf(HasSubstr("recording to"), HasSubstr("as large as it may be")));
  daemon_.reset();
  config_.camera.path = file;
  config_.camera.fps = 0;
  config_.camera.loop = false;
  config_.camera.exit_at_end = true;
  folder_.write("front.toml", config_as_toml(config_));
  ChildProcess player({LOOPD_PATH, "--config", config_file_}, (folder_ / "player").string());
  EXPECT_EQ(player.wait(kPatience), 0) << player.standard_error();
}

TEST_F(LoopctlDaemonTest, ASignalEndsARecordingWithAllItsFrames) {
  start();
  const std::string file = (folder_ / "a.rec").string();
  testing::LoopctlProcess recorder(
      folder_, {"record", file, "--control", (folder_ / "control.sock").string()});
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  const auto size = [&] {
    struct stat status {};
    return stat(file.c_str(), &status) == 0 ? status.st_size : 0;
  };
  // The first frames are on their way once the file has its header.
  while (size() <= 256 && std::chrono::steady_clock::now() < deadline &&
         !recorder.wait(std::chrono::milliseconds(5))) {
  }
  recorder.signal(SIGINT);
  EXPECT_EQ(recorder.wait(kPatience), 0) << recorder.standard_error();
  EXPECT_THAT(recorder.standard_output(), HasSubstr(": stopped\n"));
}

TEST_F(LoopctlDaemonTest, TheDoctorFindsARunningDaemonWell) {
  start();
  const LoopctlResult found = doctor();
  EXPECT_EQ(found.exit_code, 0) << found.out;
  EXPECT_THAT(
      found.out,
      AllOf(HasSubstr("ok       config: "), HasSubstr("ok       trial: 5 images of 240x180"),
            HasSubstr("ok       memory: "), HasSubstr("-        unit: not checked"),
            HasSubstr("control.sock is for the group"), HasSubstr("it is running"),
            Not(HasSubstr("PROBLEM"))));
}

TEST_F(LoopctlDaemonTest, TheDoctorSaysWhatIsWrong) {
  config_.camera.path = "/nonexistent";
  folder_.write("front.toml", config_as_toml(config_));
  const LoopctlResult found = doctor({"--json"});
  EXPECT_EQ(found.exit_code, 1);
  const json report = json::parse(found.out);
  EXPECT_EQ(report["ok"], false);
  EXPECT_THAT(found.out, HasSubstr("/nonexistent"));
  const LoopctlResult untried = doctor({"--no-trial"});
  EXPECT_EQ(untried.exit_code, 0) << untried.out;
  EXPECT_THAT(untried.out,
              AllOf(HasSubstr("trial: not checked"), HasSubstr("daemon: not checked")));
}

TEST_F(LoopctlDaemonTest, TheDoctorAsksSystemdWithoutStartingAnything) {
  folder_.write("front.toml", config_as_toml(config_));
  const TempDir programs;
  const auto systemctl = programs.write("systemctl", R"(#!/bin/sh
case "$3" in
  *.socket) echo LoadState=loaded; echo ActiveState=active ;;
  *) echo LoadState=loaded; echo UnitFileState=disabled; echo ActiveState=failed
     echo Result=exit-code; echo ExecMainStatus=2; echo User=root; echo MemoryMax=67108864 ;;
esac
)");
  std::filesystem::permissions(systemctl, std::filesystem::perms::owner_all);
  const LoopctlResult found = testing::run_loopctl(folder_, {"doctor", "--config", config_file_},
                                                   {"PATH=" + programs.string() + ":/bin"});
  EXPECT_EQ(found.exit_code, 1);
  EXPECT_THAT(found.out,
              AllOf(HasSubstr("PROBLEM  unit: loopd@front has failed (exit-code, exit status 2)"),
                    HasSubstr("not started at boot"), HasSubstr("PROBLEM  memory: "),
                    HasSubstr("asking it would start it")));
}

}  // namespace
}  // namespace loopd
