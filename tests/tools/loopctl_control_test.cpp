// loopctl's commands that change what a daemon does, against a control server made for the test.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

#include "events/control_fixture.h"
#include "tools/loopctl_process.h"

namespace loopd {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::json;
using testing::LoopctlProcess;
using ::testing::Not;

std::string content(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

class LoopctlControlTest : public testing::ControlTest {
 protected:
  std::unique_ptr<LoopctlProcess> begin(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--control", options_.socket_path});
    return std::make_unique<LoopctlProcess>(dir_, std::move(arguments));
  }
  int end(LoopctlProcess& loopctl) {
    EXPECT_TRUE(loop_.run_until([&] { return loopctl.ended(); }));
    return loopctl.wait(std::chrono::milliseconds(0)).value_or(-1);
  }
  std::unique_ptr<LoopctlProcess> run(std::vector<std::string> arguments) {
    auto loopctl = begin(std::move(arguments));
    end(*loopctl);
    return loopctl;
  }
  /// Starts a recording that the daemon has agreed to.
  std::unique_ptr<LoopctlProcess> begin_recording(std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {"record", file_.string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    auto loopctl = begin(std::move(arguments));
    EXPECT_TRUE(loop_.run_until([&] {
      return loopctl->standard_output().find("recording to") != std::string::npos ||
             loopctl->ended();
    }));
    return loopctl;
  }
  void tell_recorded(std::int64_t frames, std::int64_t lost, const std::string& reason) {
    ASSERT_FALSE(requests_.empty());
    EXPECT_TRUE(server_->send(requests_.front().client, "recorded",
                              {{"frames", frames},
                               {"bytes", std::int64_t{3} << 20},
                               {"lost", lost},
                               {"reason", reason}}));
  }

  const std::filesystem::path file_ = dir_ / "a.rec";
};

TEST_F(LoopctlControlTest, AsksForWhatItIsNamedAfter) {
  start();
  const std::vector<std::pair<std::string, ControlOp>> ops = {{"pause", ControlOp::kPause},
                                                              {"resume", ControlOp::kResume},
                                                              {"reset", ControlOp::kReset},
                                                              {"reload", ControlOp::kReload}};
  for (const auto& [name, op] : ops) {
    const auto loopctl = run({name});
    EXPECT_EQ(loopctl->wait(), 0) << loopctl->standard_error();
    ASSERT_FALSE(requests_.empty());
    EXPECT_EQ(requests_.back().op, op);
    EXPECT_FALSE(loopctl->standard_output().empty());
  }
  EXPECT_EQ(requests_.size(), ops.size());
}

TEST_F(LoopctlControlTest, PrintsWhatTheDaemonSays) {
  start();
  reply_.fields = {{"result", "camera.fps is taken over"}};
  EXPECT_EQ(run({"reload"})->standard_output(), "camera.fps is taken over\n");
  const json answer = json::parse(run({"reload", "--json"})->standard_output());
  EXPECT_EQ(answer["class"], "ok");
  EXPECT_EQ(answer["result"], "camera.fps is taken over");
}

TEST_F(LoopctlControlTest, ARefusalIsAComplaintAndOne) {
  start();
  reply_ = ControlReply::refusal("front.toml:3: no such key");
  const auto loopctl = run({"reload"});
  EXPECT_EQ(loopctl->wait(), 1);
  EXPECT_EQ(loopctl->standard_error(), "loopctl: front.toml:3: no such key\n");
}

TEST_F(LoopctlControlTest, NoDaemonIsSaid) {
  for (const char* command : {"pause", "resume", "reset", "reload"}) {
    const auto loopctl = run({command});
    EXPECT_EQ(loopctl->wait(), 1);
    EXPECT_THAT(loopctl->standard_error(),
                AllOf(HasSubstr(options_.socket_path), HasSubstr("is the daemon running")));
  }
  EXPECT_EQ(run({"record", file_.string()})->wait(), 1);
  EXPECT_FALSE(std::filesystem::exists(file_));
}

TEST_F(LoopctlControlTest, WhoMayNotIsToldHowTo) {
  options_.mode = 0;
  start();
  std::vector<std::string> command = {LOOPCTL_PATH, "pause", "--control", options_.socket_path};
  if (geteuid() == 0) {  // who may everything, and so asks as somebody else
    const std::vector<std::string> as_nobody = {"/usr/bin/setpriv", "--reuid=65534",
                                                "--regid=65534", "--clear-groups"};
    command.insert(command.begin(), as_nobody.begin(), as_nobody.end());
  }
  testing::ChildProcess loopctl(command, (dir_ / "loopctl").string());
  const int exit_code = loopctl.wait().value_or(-1);
  if (exit_code == 126 || exit_code == 127) GTEST_SKIP() << "others cannot run " << LOOPCTL_PATH;
  EXPECT_EQ(exit_code, 1);
  EXPECT_THAT(loopctl.standard_error(),
              AllOf(HasSubstr(options_.socket_path), HasSubstr("permission denied"),
                    HasSubstr("join the group")));
}

TEST_F(LoopctlControlTest, FindsTheSocketByEnvironmentOrCamera) {
  const auto by_environment =
      testing::run_loopctl(dir_, {"pause"}, {"LOOPD_CONTROL=/nowhere/c.sock"});
  EXPECT_THAT(by_environment.err, HasSubstr("\"/nowhere/c.sock\""));
  const auto by_camera = testing::run_loopctl(dir_, {"pause", "--camera", "no-such"});
  EXPECT_THAT(by_camera.err, HasSubstr("\"/run/loopd/no-such/control.sock\""));
}

TEST_F(LoopctlControlTest, RecordHandsItsFileOverAndTellsTheEnd) {
  start();
  const auto loopctl = begin_recording({"--seconds", "2.5", "--max-mib", "7"});
  ASSERT_EQ(requests_.size(), 1u) << loopctl->standard_error();
  EXPECT_EQ(requests_[0].op, ControlOp::kRecord);
  EXPECT_EQ(requests_[0].limits.seconds, 2.5);
  EXPECT_EQ(requests_[0].limits.max_bytes, std::uint64_t{7} << 20);
  ASSERT_EQ(write(requests_[0].file.get(), "frames", 6), 6);
  tell_recorded(12, 0, "time");
  EXPECT_EQ(end(*loopctl), 0) << loopctl->standard_error();
  EXPECT_THAT(loopctl->standard_output(),
              AllOf(HasSubstr("at most 2.5 s and 7 MiB"), HasSubstr("recorded 12 frames, 3.0 MiB"),
                    HasSubstr("its time is over"), HasSubstr("--set camera.path=")));
  EXPECT_EQ(content(file_), "frames");
  struct stat status {};
  ASSERT_EQ(stat(file_.c_str(), &status), 0);
  const mode_t mask = umask(0);
  umask(mask);
  EXPECT_EQ(status.st_mode & 0777, 0644 & ~mask);
}

TEST_F(LoopctlControlTest, RecordEndsInOrderOnASignal) {
  start();
  for (const int signal : {SIGINT, SIGTERM}) {
    requests_.clear();
    const auto loopctl = begin_recording({"--force"});
    loopctl->signal(signal);
    ASSERT_TRUE(loop_.run_until([&] { return requests_.size() == 2 || loopctl->ended(); }));
    ASSERT_EQ(requests_.size(), 2u) << loopctl->standard_error();
    EXPECT_EQ(requests_[1].op, ControlOp::kStopRecord);
    EXPECT_EQ(requests_[1].client, requests_[0].client);
    loop_.run_ready();
    EXPECT_FALSE(loopctl->ended()) << "the last frames are still to be written";
    tell_recorded(3, 0, "stopped");
    EXPECT_EQ(end(*loopctl), 0) << loopctl->standard_error();
    EXPECT_THAT(loopctl->standard_output(), HasSubstr("recorded 3 frames"));
  }
}

TEST_F(LoopctlControlTest, ASecondSignalGivesUpWaiting) {
  start();
  const auto loopctl = begin_recording();
  loopctl->signal(SIGINT);
  ASSERT_TRUE(loop_.run_until([&] { return requests_.size() == 2; }));
  loop_.run_ready();
  loopctl->signal(SIGINT);
  EXPECT_EQ(end(*loopctl), 1);
  EXPECT_THAT(loopctl->standard_error(), HasSubstr("not awaited"));
}

TEST_F(LoopctlControlTest, LostFramesAreOne) {
  start();
  const auto loopctl = begin_recording();
  tell_recorded(12, 4, "time");
  EXPECT_EQ(end(*loopctl), 1);
  EXPECT_THAT(loopctl->standard_output(), HasSubstr("4 frames are missing"));
  EXPECT_TRUE(std::filesystem::exists(file_));
}

TEST_F(LoopctlControlTest, ARecordingOfNothingIsOne) {
  start();
  const auto loopctl = begin_recording();
  tell_recorded(0, 0, "time");
  EXPECT_EQ(end(*loopctl), 1);
  EXPECT_THAT(loopctl->standard_output(), Not(HasSubstr("play it with")));
}

TEST_F(LoopctlControlTest, ARefusedRecordingLeavesNothingAndCostsNothing) {
  start();
  reply_ = ControlReply::refusal("another recording is under way");
  const auto loopctl = run({"record", file_.string()});
  EXPECT_EQ(loopctl->wait(), 1);
  EXPECT_THAT(loopctl->standard_error(), HasSubstr("another recording is under way"));
  EXPECT_FALSE(std::filesystem::exists(file_));
  dir_.write("a.rec", "old");
  EXPECT_EQ(run({"record", file_.string(), "--force"})->wait(), 1);
  EXPECT_EQ(content(file_), "old") << "what was to be replaced is still there";
}

TEST_F(LoopctlControlTest, AFileThatIsThereIsNotAskedFor) {
  start();
  dir_.write("a.rec", "old");
  const auto loopctl = run({"record", file_.string()});
  EXPECT_EQ(loopctl->wait(), 1);
  EXPECT_THAT(loopctl->standard_error(), HasSubstr("--force"));
  EXPECT_TRUE(requests_.empty());
  EXPECT_EQ(content(file_), "old");
}

TEST_F(LoopctlControlTest, ADaemonThatGoesAwayEndsTheRecording) {
  start();
  const auto loopctl = begin_recording();
  server_.reset();
  EXPECT_EQ(end(*loopctl), 1);
  EXPECT_THAT(loopctl->standard_error(), HasSubstr("has closed the connection"));
  EXPECT_TRUE(std::filesystem::exists(file_)) << "what there is of it can be read";
}

TEST_F(LoopctlControlTest, RefusesWrongArguments) {
  const std::vector<std::vector<std::string>> wrong = {{"record"},
                                                       {"record", "a", "--seconds", "0"},
                                                       {"record", "a", "--seconds", "1e9"},
                                                       {"record", "a", "--max-mib", "0"},
                                                       {"record", "a", "--max-mib", "-3"},
                                                       {"pause", "now"},
                                                       {"doctor", "a/b"},
                                                       {"doctor", ""},
                                                       {"cameras", "all"}};
  for (const std::vector<std::string>& arguments : wrong) {
    const auto result = testing::run_loopctl(dir_, arguments);
    EXPECT_GT(result.exit_code, 1) << arguments[0];
    EXPECT_FALSE(result.err.empty());
  }
}

}  // namespace
}  // namespace loopd
