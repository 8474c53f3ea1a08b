// The daemon as its users meet it: a process with a config, a socket, signals and systemd.
#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>

#include "app/config_file.h"
#include "app/daemon_fixture.h"
#include "base/unique_fd.h"

namespace loopd {
namespace {

using testing::ChildProcess;
using testing::DaemonTest;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::json;
using testing::kPatience;
using testing::kPlaces;
using testing::LoopSeen;
using ::testing::StartsWith;
using testing::TempDir;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr int kSlowness = 10;  // sanitizers
#else
constexpr int kSlowness = 1;
#endif

TEST_F(DaemonTest, LoopsOnTheSocketAreTheDetectorsAndASilentClientCostsNobodyAnything) {
  const auto images = laps();
  const auto expected = testing::loops_of_detector_alone(testing::small_config(images.string()));
  ASSERT_GE(expected.size(), 5u) << "the sequence proves nothing without loops";
  start(images, {"camera.wait_for_clients=4", "camera.exit_at_end=true"});
  ASSERT_TRUE(notify_.wait_for("READY=1"));
  EventClient first = watcher({RecordClass::kLoop, RecordClass::kState});
  EventClient second = watcher({RecordClass::kLoop, RecordClass::kState}, true);
  const ClassSet everything{RecordClass::kLoop, RecordClass::kCandidate, RecordClass::kState,
                            RecordClass::kStats};
  const EventClient never_reads = watcher(everything, true);
  const EventClient starter = connected();
  EXPECT_EQ(loops_until_the_end(first), expected);
  EXPECT_EQ(loops_until_the_end(second), expected);
  EXPECT_EQ(daemon_->wait(kPatience), 0) << errors();
}

TEST_F(DaemonTest, ConfigFileAndSetsWorkTogether) {
  const auto images = laps();
  DaemonConfig config = testing::small_config(images.string());
  config.events.socket = socket_;
  config.camera.name = "rear";
  const auto file = folder_.write("rear.toml", config_as_toml(config));
  EXPECT_EQ(run({"--config", file.string(), "--set", "camera.exit_at_end=true"}), 0) << errors();
  EXPECT_THAT(errors(), HasSubstr("camera=rear"));
  EXPECT_FALSE(std::filesystem::exists(socket_)) << "the socket file is left behind";
}

TEST_F(DaemonTest, TermEndsItWithinASecondWhateverItDoes) {
  const auto images = laps();
  const std::vector<std::vector<std::string>> works = {
      {"camera.fps=30", "camera.loop=true"},           // real time
      {"camera.loop=true"},                            // lock-step, as fast as it can
      {"camera.fps=50", "camera.faults=unplug@3:1h"},  // camera away
      {"camera.wait_for_clients=9"},                   // not started
      {"camera.fps=0.01"}};                            // between two frames
  for (const auto& work : works) {
    start(images, work);
    ASSERT_TRUE(notify_.wait_for("READY=1"));
    EventClient silent = watcher({RecordClass::kLoop, RecordClass::kCandidate}, true);
    if (work[0] != "camera.wait_for_clients=9") {
      EventClient states = watcher({RecordClass::kState});
      const bool away = work.size() > 1 && work[1].starts_with("camera.faults");
      ASSERT_TRUE(read_until(states, "state", away ? "camera_lost" : "running")) << work[0];
    }
    const auto before = std::chrono::steady_clock::now();
    daemon_->signal(SIGTERM);
    EXPECT_EQ(daemon_->wait(kPatience), 0) << errors();
    EXPECT_LT(std::chrono::steady_clock::now() - before, std::chrono::seconds(kSlowness))
        << work[0];
    EXPECT_TRUE(notify_.has("STOPPING=1")) << work[0];
    EXPECT_FALSE(std::filesystem::exists(socket_));
  }
}

TEST_F(DaemonTest, InterruptEndsItAndHangupDoesNot) {
  start(laps(), {"camera.fps=30", "camera.loop=true"});
  ASSERT_TRUE(notify_.wait_for("READY=1"));
  EventClient client = watcher({RecordClass::kState});
  daemon_->signal(SIGHUP);
  ASSERT_TRUE(read_until(client, "state", "running"));
  daemon_->signal(SIGINT);
  ASSERT_TRUE(read_until(client, "state", "shutting_down"));
  EXPECT_EQ(daemon_->wait(kPatience), 0);
  EXPECT_THAT(errors(), HasSubstr("reload camera=front result=\"nothing has changed\""));
  EXPECT_THAT(errors(), HasSubstr("ending signal=SIGINT"));
}

TEST_F(DaemonTest, FeedsTheWatchdogWhileItDetectsAndWhileTheCameraIsKnownToBeLost) {
  start(laps(), {"camera.fps=20", "camera.faults=unplug@10:1h", "events.stats_interval_s=0.1"},
        {"WATCHDOG_USEC=2000000"});
  ASSERT_TRUE(notify_.wait_for("READY=1"));
  ASSERT_TRUE(notify_.wait_for("STATUS="));
  ASSERT_TRUE(notify_.wait_for("WATCHDOG=1"));
  EventClient client = watcher({RecordClass::kState});
  const auto lost = read_until(client, "state", "camera_lost");
  ASSERT_TRUE(lost);
  EXPECT_FALSE(lost->value("cause", "").empty());
  notify_.has("WATCHDOG=1");  // drops the older ones
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(notify_.wait_for("WATCHDOG=1")) << i;
}

// Nobody reads the notify socket after READY: a stuck service manager costs the clients nothing.
TEST_F(DaemonTest, StaysAndServesAfterTheEndOfARecording) {
  start(laps(), {"events.stats_interval_s=0.05"});
  ASSERT_TRUE(notify_.wait_for("READY=1"));
  EventClient client = watcher({RecordClass::kState});
  ASSERT_TRUE(read_until(client, "state", "camera_end"));
  EventClient late = watcher({RecordClass::kStats});
  std::uint64_t frames = 0;  // of the first records maybe still an older count, repeated for it
  for (int i = 0; i < 100 && frames != 2 * kPlaces; ++i) {
    const auto stats = read_until(late, "class", "stats");
    ASSERT_TRUE(stats);
    frames = (*stats)["frames"];
  }
  EXPECT_EQ(frames, 2u * kPlaces);
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(read_until(late, "class", "stats"));  // and on
  daemon_->signal(SIGTERM);
  EXPECT_EQ(daemon_->wait(kPatience), 0);
}

TEST_F(DaemonTest, AllTenMistakesAreListed) {
  const auto file = folder_.write("bad.toml",
                                  "[camera]\nname = \"\"\nfps = 2000\nloop = \"yes\"\nbufers = 4\n"
                                  "[cammera]\nx = 1\n"
                                  "[threads]\nlanes = 3\n"
                                  "[verify]\nmin_inliers = 2\nseed = -1\n");
  EXPECT_EQ(
      run({"--config", file.string(), "--set", "features.points=none", "--set", "camera.start=-1"}),
      2);
  const std::string text = errors();
  for (const char* mistake :
       {"bad.toml:2: camera.name = \"\"", "bad.toml:3: camera.fps = 2000",
        "bad.toml:4: camera.loop",
        "bad.toml:5: there is no parameter camera.bufers; did you mean camera.buffers?",
        "bad.toml:6: there is no section [cammera]; did you mean [camera]?",
        "bad.toml:9: threads.lanes = 3", "bad.toml:11: verify.min_inliers = 2",
        "bad.toml:12: verify.seed = -1", "--set: features.points expects a whole number",
        "--set: camera.start = -1"})
    EXPECT_THAT(text, HasSubstr(mistake));
}

TEST_F(DaemonTest, CheckPrintsTheConfigAndItsMemory) {
  EXPECT_EQ(run({"--check", "--set", "camera.path=/data", "--set", "camera.buffers=5"}), 0);
  const std::string text = daemon_->standard_output();
  EXPECT_THAT(text, HasSubstr("buffers = 5\n"));
  EXPECT_THAT(text, HasSubstr("# memory, all:            256.0 MiB"));
  EXPECT_THAT(text, HasSubstr("frame buffers         40.0 MiB"));
  EXPECT_TRUE(parse_config(text, "check", {}).ok()) << "the output is a config file again";
}

TEST_F(DaemonTest, PrintsTheShippedConfigAndItsVersion) {
  EXPECT_EQ(run({"--print-config"}), 0);
  EXPECT_EQ(daemon_->standard_output(), config_as_toml(DaemonConfig{}));
  EXPECT_EQ(run({"--version"}), 0);
  EXPECT_THAT(daemon_->standard_output(), StartsWith("loopd "));
}

TEST_F(DaemonTest, BadCommandLinesAndMissingSettingsAreSaid) {
  EXPECT_EQ(run({"--nonsense"}), 2);
  EXPECT_THAT(errors(), HasSubstr("--nonsense"));
  EXPECT_EQ(run({"--config", "/nonexistent.toml"}), 2);
  EXPECT_THAT(errors(), HasSubstr("/nonexistent.toml: No such file"));
  EXPECT_EQ(run({}), 2);
  EXPECT_THAT(errors(), HasSubstr("camera.path is not set"));
}

TEST_F(DaemonTest, CamerasThatCannotBeOpenedAreSaid) {
  const TempDir empty;
  EXPECT_EQ(run({"--set", "camera.path=" + empty.string()}), 1);
  EXPECT_THAT(errors(), HasSubstr(empty.string()));
  EXPECT_EQ(run({"--set", "camera.path=/nonexistent"}), 1);
  EXPECT_THAT(errors(), HasSubstr("/nonexistent"));
}

TEST_F(DaemonTest, SocketPathsThatCannotBeUsedAreSaid) {
  const auto images = laps();
  start(images, {"camera.wait_for_clients=9"});
  ASSERT_TRUE(notify_.wait_for("READY=1"));
  ChildProcess second(
      {LOOPD_PATH, "--set", "camera.path=" + images.string(), "--set", "events.socket=" + socket_},
      (folder_ / "second").string());
  EXPECT_EQ(second.wait(kPatience), 1);
  EXPECT_THAT(second.standard_error(), HasSubstr(socket_));
  EventClient still_served = watcher({RecordClass::kState});

  ChildProcess too_long({LOOPD_PATH, "--set", "camera.path=" + images.string(), "--set",
                         "events.socket=/tmp/" + std::string(120, 'x')},
                        (folder_ / "third").string());
  EXPECT_EQ(too_long.wait(kPatience), 2);
  EXPECT_THAT(too_long.standard_error(), HasSubstr("events.socket is at most 107 bytes long"));

  ChildProcess no_folder({LOOPD_PATH, "--set", "camera.path=" + images.string(), "--set",
                          "events.socket=" + (folder_ / "none/s").string()},
                         (folder_ / "fourth").string());
  EXPECT_EQ(no_folder.wait(kPatience), 1);
  EXPECT_THAT(no_folder.standard_error(), HasSubstr("none/s"));
}

}  // namespace
}  // namespace loopd
