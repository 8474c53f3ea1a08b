#include <fcntl.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <fstream>
#include <sstream>

#include "events/sample_report.h"
#include "events/server_fixture.h"

namespace loopd {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::json;
using ::testing::MatchesRegex;
using testing::sample_report;
using testing::TempDir;

/// loopctl as a process of its own, its output in two files.
class Loopctl {
 public:
  Loopctl(const TempDir& dir, std::vector<std::string> arguments,
          std::vector<std::string> environment = {})
      : out_(dir / "out"), err_(dir / "err") {
    arguments.insert(arguments.begin(), LOOPCTL_PATH);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC;
    posix_spawn_file_actions_addopen(&actions, 1, out_.c_str(), kFlags, 0600);
    posix_spawn_file_actions_addopen(&actions, 2, err_.c_str(), kFlags, 0600);
    EXPECT_EQ(posix_spawn(&pid_, LOOPCTL_PATH, &actions, nullptr, pointers(arguments).data(),
                          pointers(environment).data()),
              0);
    posix_spawn_file_actions_destroy(&actions);
  }
  ~Loopctl() {
    if (pid_ <= 0) return;
    kill(SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  Loopctl(const Loopctl&) = delete;
  Loopctl& operator=(const Loopctl&) = delete;

  void kill(int signal) const { ::kill(pid_, signal); }
  bool ended() {
    int status = 0;
    if (pid_ > 0 && waitpid(pid_, &status, WNOHANG) == pid_) {
      pid_ = 0;
      exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    }
    return pid_ == 0;
  }
  int exit_code() const { return exit_code_; }
  std::string out() const { return text(out_); }
  std::string err() const { return text(err_); }
  std::vector<std::string> lines() const {
    std::istringstream stream(out());
    std::vector<std::string> lines;
    for (std::string line; std::getline(stream, line);) lines.push_back(line);
    return lines;
  }

 private:
  static std::vector<char*> pointers(std::vector<std::string>& texts) {
    std::vector<char*> pointers;
    for (std::string& text : texts) pointers.push_back(text.data());
    pointers.push_back(nullptr);
    return pointers;
  }
  static std::string text(const std::filesystem::path& file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  }

  std::filesystem::path out_;
  std::filesystem::path err_;
  pid_t pid_ = 0;
  int exit_code_ = -1;
};

class LoopctlTest : public testing::ServerTest {
 protected:
  std::unique_ptr<Loopctl> run(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--socket", options_.socket_path});
    return std::make_unique<Loopctl>(dir_, std::move(arguments));
  }
  bool wait_for_end(Loopctl& loopctl) {
    return loop_.run_until([&] { return loopctl.ended(); });
  }
  bool wait_for_output(const Loopctl& loopctl, const std::string& text) {
    return loop_.run_until([&] { return loopctl.out().find(text) != std::string::npos; });
  }
};

Report small_report() {
  Report report = sample_report();
  report.sequence = 812;
  return report;
}

TEST_F(LoopctlTest, WatchPrintsLinesForPeople) {
  start();
  const auto loopctl = run({"watch", "--classes", "loop,candidate,state,stats", "--count", "2"});
  ASSERT_TRUE(wait_for_output(*loopctl, "connected to loopd 0.1.0, camera front"));
  publish_state();
  ASSERT_TRUE(wait_for_output(*loopctl, "STATE"));
  server_->publish_state({State::kCameraLost, 1, "gone\x1b[2J", "plug it in"});
  server_->publish(small_report(), {std::nullopt, 38'000'000});
  Report rejected = small_report();
  rejected.outcome = Outcome::kFewInliers;
  server_->publish(rejected);
  StatsRecord stats;
  stats.frames = 300;
  stats.bytes = 1024 * 1024;
  server_->publish_stats(stats);
  server_->publish(small_report());
  ASSERT_TRUE(wait_for_end(*loopctl));
  EXPECT_EQ(loopctl->exit_code(), 0) << loopctl->err();
  const std::vector<std::string> lines = loopctl->lines();
  ASSERT_EQ(lines.size(), 7u) << loopctl->out();
  EXPECT_THAT(lines[2], HasSubstr("STATE camera_lost: gone?[2J [plug it in]"));
  EXPECT_THAT(lines[3], MatchesRegex("..:..:..\\.... LOOP frame 812 = frame 98 \\(inliers 143: 121 "
                                     "points, 22 lines; similarity 0.61; 38 ms\\)"));
  EXPECT_THAT(lines[4], HasSubstr("candidate frame 812 ? frame 98 rejected: few_inliers"));
  EXPECT_THAT(lines[5], HasSubstr("STATS 300 frames, 0 dropped"));
}

TEST_F(LoopctlTest, WatchJsonPrintsTheRecordsThemselves) {
  start();
  const auto loopctl = run({"watch", "--json", "--pairs", "--count", "1"});
  ASSERT_TRUE(wait_for_output(*loopctl, "\"watch\""));
  server_->publish(small_report());
  ASSERT_TRUE(wait_for_end(*loopctl));
  const std::vector<std::string> lines = loopctl->lines();
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[2], report_text(small_report(), {}, {"e1", 1}, true));
}

TEST_F(LoopctlTest, WatchEndsWellOnASignal) {
  start();
  for (int signal : {SIGINT, SIGTERM}) {
    const auto loopctl = run({"watch"});
    ASSERT_TRUE(wait_for_output(*loopctl, "connected"));
    loopctl->kill(signal);
    ASSERT_TRUE(wait_for_end(*loopctl));
    EXPECT_EQ(loopctl->exit_code(), 0);
  }
}

TEST_F(LoopctlTest, WatchEndsAtItsTimeLimit) {
  start();
  const auto limited = run({"watch", "--timeout", "0.05"});
  ASSERT_TRUE(wait_for_end(*limited));
  EXPECT_EQ(limited->exit_code(), 0) << limited->err();
  const auto unlucky = run({"watch", "--timeout", "0.05", "--count", "3"});
  ASSERT_TRUE(wait_for_end(*unlucky));
  EXPECT_EQ(unlucky->exit_code(), 1);
  EXPECT_THAT(unlucky->err(), HasSubstr("only 0 of 3 loops"));
}

TEST_F(LoopctlTest, WatchTellsAnEndInOrderFromAnother) {
  start();
  const auto orderly = run({"watch"});
  ASSERT_TRUE(wait_for_output(*orderly, "connected"));
  ASSERT_TRUE(loop_.run_until([&] { return server_->clients() == 1; }));
  loop_.run_ready();
  server_->publish_state({State::kShuttingDown, 1, "", ""});
  ASSERT_TRUE(wait_for_output(*orderly, "shutting_down"));
  server_.reset();
  ASSERT_TRUE(wait_for_end(*orderly));
  EXPECT_EQ(orderly->exit_code(), 0) << orderly->err();
  start();
  const auto abrupt = run({"watch"});
  ASSERT_TRUE(wait_for_output(*abrupt, "connected"));
  server_.reset();
  ASSERT_TRUE(wait_for_end(*abrupt));
  EXPECT_EQ(abrupt->exit_code(), 1);
  EXPECT_THAT(abrupt->err(), HasSubstr("has closed the connection"));
}

TEST_F(LoopctlTest, RetryFindsTheDaemonAgain) {
  const auto loopctl = run({"watch", "--retry", "--json", "--count", "2"});
  ASSERT_TRUE(loop_.run_until([&] { return !loopctl->err().empty(); }));
  for (std::size_t round = 1; round <= 2; ++round) {
    start();
    ASSERT_TRUE(loop_.run_until([&] { return loopctl->lines().size() >= round * 3 - 1; }));
    server_->publish(small_report());
    ASSERT_TRUE(loop_.run_until([&] { return loopctl->lines().size() >= round * 3; }));
    server_.reset();
  }
  ASSERT_TRUE(wait_for_end(*loopctl));
  EXPECT_EQ(loopctl->exit_code(), 0) << loopctl->err();
  EXPECT_THAT(loopctl->err(), HasSubstr("trying again"));
}

TEST_F(LoopctlTest, StatusShowsTheNewest) {
  start();
  server_->publish_state({State::kCameraStalled, 1, "no frames for 3 s", "check the cable"});
  StatsRecord stats;
  stats.uptime_ns = 3'725'000'000'000;
  stats.frames = 1234;
  stats.frame_rate_hz = 12.06;
  stats.bytes = 3 * 512 * 1024;
  stats.stage_means = StageTimes{20'100'000, 1, 1, 1, 43'900'000};
  server_->publish_stats(stats);
  const auto loopctl = run({"status"});
  ASSERT_TRUE(wait_for_end(*loopctl));
  EXPECT_EQ(loopctl->exit_code(), 0) << loopctl->err();
  EXPECT_THAT(loopctl->out(),
              AllOf(HasSubstr("camera front: camera_stalled\n"), HasSubstr("check the cable"),
                    HasSubstr("1 h 2 min"), HasSubstr("1234 frames (12.1/s)"), HasSubstr("1.5 MiB"),
                    HasSubstr("features 20.1, ")));
}

TEST_F(LoopctlTest, StatusJsonIsOneObject) {
  start();
  publish_state();
  const auto loopctl = run({"status", "--json"});
  ASSERT_TRUE(wait_for_end(*loopctl));
  const json parsed = json::parse(loopctl->out());
  EXPECT_EQ(parsed["hello"]["epoch"], "e1");
  EXPECT_EQ(parsed["state"]["state"], "running");
  EXPECT_TRUE(parsed["stats"].is_null()) << "none was published yet";
}

TEST_F(LoopctlTest, NamesWhatIsWrongWhenThereIsNoDaemon) {
  for (const char* command : {"watch", "status"}) {
    const auto loopctl = run({command});
    ASSERT_TRUE(wait_for_end(*loopctl));
    EXPECT_EQ(loopctl->exit_code(), 1);
    EXPECT_THAT(loopctl->err(),
                AllOf(HasSubstr(options_.socket_path), HasSubstr("is the daemon running")));
  }
}

TEST_F(LoopctlTest, TellsWhenTheDaemonIsFull) {
  options_.max_clients = 1;
  start();
  const auto only = connect();
  const auto status = run({"status"});
  ASSERT_TRUE(wait_for_end(*status));
  EXPECT_EQ(status->exit_code(), 1);
  EXPECT_THAT(status->err(), HasSubstr("too many clients"));
  const auto watch = run({"watch"});
  ASSERT_TRUE(wait_for_end(*watch));
  EXPECT_EQ(watch->exit_code(), 1);
  EXPECT_THAT(watch->out(), HasSubstr("ERROR too many clients"));
}

TEST_F(LoopctlTest, FindsTheSocketByEnvironmentOrCamera) {
  Loopctl by_environment(dir_, {"status"}, {"LOOPD_SOCKET=/nowhere/a.sock"});
  ASSERT_TRUE(wait_for_end(by_environment));
  EXPECT_THAT(by_environment.err(), HasSubstr("\"/nowhere/a.sock\""));
  Loopctl by_camera(dir_, {"status", "--camera", "no such camera"});
  ASSERT_TRUE(wait_for_end(by_camera));
  EXPECT_THAT(by_camera.err(), HasSubstr("\"/run/loopd/no such camera/events.sock\""));
}

TEST_F(LoopctlTest, RefusesWrongArguments) {
  const std::vector<std::vector<std::string>> wrong = {
      {},
      {"fly"},
      {"watch", "--classes", "loops"},
      {"watch", "--classes", "state", "--count", "1"},
      {"watch", "--count", "0"},
      {"watch", "--timeout", "-1"}};
  for (const std::vector<std::string>& arguments : wrong) {
    Loopctl loopctl(dir_, arguments);
    ASSERT_TRUE(wait_for_end(loopctl));
    EXPECT_GT(loopctl.exit_code(), 0);
    EXPECT_FALSE(loopctl.err().empty());
  }
}

}  // namespace
}  // namespace loopd
