// What the doctor makes of facts, which are made up here.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <deque>
#include <filesystem>

#include "base/frame_pool.h"
#include "loopctl/doctor_access.h"
#include "loopctl/doctor_camera.h"
#include "loopctl/doctor_config.h"
#include "loopctl/doctor_daemon.h"
#include "loopctl/doctor_threads.h"
#include "loopctl/doctor_trial.h"
#include "loopctl/doctor_unit.h"
#include "support/temp_dir.h"

namespace loopd::loopctl {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing::TempDir;
using Level = Finding::Level;

/// The worst of what was found; kOk if nothing was.
Level worst(const Findings& findings) {
  Level level = Level::kOk;
  for (const Finding& finding : findings) level = std::max(level, finding.level);
  return level;
}

std::string text(const Findings& findings) { return findings_text(findings); }

// --- settings

TEST(DoctorConfig, EveryMistakeIsAProblem) {
  const TempDir folder;
  const auto file = folder.write("a.toml", "[camera]\nsource = \"film\"\nwidht = 3\n");
  const CheckedConfig checked = check_config(file.string(), "front");
  EXPECT_FALSE(checked.config);
  EXPECT_THAT(text(checked.findings), AllOf(HasSubstr("camera.width"), HasSubstr("film"),
                                            HasSubstr("camera.path is not set")));
}

TEST(DoctorConfig, AValidFileIsReadAsTheServiceReadsIt) {
  const TempDir folder;
  const auto file = folder.write("a.toml", "[camera]\nname = \"x\"\npath = \"/data\"\n");
  const CheckedConfig checked = check_config(file.string(), "rear");
  ASSERT_TRUE(checked.config) << text(checked.findings);
  EXPECT_EQ(checked.config->camera.name, "rear");
  EXPECT_EQ(worst(checked.findings), Level::kOk);
  const CheckedConfig missing = check_config((folder / "b.toml").string(), "rear");
  EXPECT_THAT(text(missing.findings), HasSubstr("PROBLEM  config: there is no "));
}

TEST(DoctorConfig, ClassesOfDevicesMustBeRegistered) {
  const std::string all =
      "Character devices:\n  1 mem\n 81 video4linux\n247 media\n\nBlock devices:\n";
  EXPECT_THAT(judge_device_classes(all, "libcamera"), IsEmpty());
  const std::string none = "Character devices:\n  1 mem\n\nBlock devices:\n 81 video4linux\n";
  EXPECT_THAT(text(judge_device_classes(none, "v4l2")), HasSubstr("modprobe videodev"));
  EXPECT_EQ(judge_device_classes(none, "libcamera").size(), 2u);
  EXPECT_THAT(judge_device_classes(none, "file"), IsEmpty());
}

TEST(DoctorConfig, MemoryIsTheUnitsOrTheMachines) {
  constexpr std::uint64_t kGib = std::uint64_t{1} << 30;
  const DaemonConfig config;
  EXPECT_EQ(judge_memory(config, kGib, 8 * kGib).level, Level::kOk);
  EXPECT_THAT(judge_memory(config, kGib, 8 * kGib).text,
              HasSubstr("1024 MiB that the unit allows"));
  EXPECT_THAT(judge_memory(config, std::nullopt, 2 * kGib).text, HasSubstr("of this machine"));
  EXPECT_THAT(judge_memory(config, 9 * kGib, 2 * kGib).text, HasSubstr("2048 MiB of this machine"));
  const Finding tight = judge_memory(config, kGib / 4, 8 * kGib);
  EXPECT_EQ(tight.level, Level::kProblem);
  EXPECT_THAT(tight.remedy, HasSubstr("MemoryMax"));
  EXPECT_THAT(judge_memory(config, std::nullopt, kGib / 4).remedy, Not(HasSubstr("MemoryMax")));
  DaemonConfig small;
  small.memory.budget_mib = 96;
  EXPECT_EQ(judge_memory(small, kGib / 4, 8 * kGib).level, Level::kWarning);
  EXPECT_THAT(judge_memory(small, kGib / 4, 8 * kGib).remedy, HasSubstr("memory.budget_mib"));
}

// --- permissions

TEST(DoctorAccess, FollowsTheModeForOwnerGroupAndOthers) {
  const Ownership node{1, 44, S_IFCHR | 0660, "video"};
  EXPECT_TRUE(may_use({"root", 0, {}}, node, 6));
  EXPECT_TRUE(may_use({"owner", 1, {}}, node, 6));
  EXPECT_TRUE(may_use({"loopd", 999, {999, 44}}, node, 6));
  EXPECT_FALSE(may_use({"loopd", 999, {999}}, node, 6));
  const Ownership closed_to_owner{999, 44, S_IFCHR | 0066, "video"};
  EXPECT_FALSE(may_use({"loopd", 999, {44}}, closed_to_owner, 6)) << "the owner's bits come first";
}

TEST(DoctorAccess, SaysWhichGroupHelps) {
  const DaemonUser user{"loopd", 999, {999}};
  const Finding group = judge_node_access("/dev/video0", {0, 44, S_IFCHR | 0660, "video"}, user);
  EXPECT_EQ(group.level, Level::kProblem);
  EXPECT_THAT(group.remedy, HasSubstr("usermod -aG video loopd"));
  const Finding root = judge_node_access("/dev/video0", {0, 0, S_IFCHR | 0600, "root"}, user);
  EXPECT_EQ(root.level, Level::kProblem);
  EXPECT_THAT(root.remedy, AllOf(HasSubstr("udev"), Not(HasSubstr("usermod"))));
  EXPECT_EQ(judge_node_access("/dev/video0", {0, 999, S_IFCHR | 0660, "loopd"}, user).level,
            Level::kOk);
}

TEST(DoctorAccess, TheDaemonMustReadItsConfig) {
  const DaemonUser user{"loopd", 999, {999}};
  EXPECT_THAT(judge_config_access("/e/f.toml", {0, 0, S_IFREG | 0644, "root"}, user), IsEmpty());
  EXPECT_THAT(text(judge_config_access("/e/f.toml", {0, 0, S_IFREG | 0600, "root"}, user)),
              AllOf(HasSubstr("PROBLEM"), HasSubstr("chmod a+r /e/f.toml")));
}

TEST(DoctorAccess, UsersAreLookedUp) {
  const auto root = find_user("root", "no_such_group daemon");
  ASSERT_TRUE(root);
  EXPECT_EQ(root->uid, 0u);
  EXPECT_GE(root->groups.size(), 2u) << "its own, and the one added";
  EXPECT_FALSE(find_user("no such user", ""));
  EXPECT_FALSE(ownership_of("/nonexistent"));
}

// --- camera

CameraListing listing_of(const std::string& node) {
  CameraListing listing;
  listing.node = node;
  listing.name = "Webcam";
  return listing;
}

TEST(DoctorCamera, FindsTheNodeBehindALink) {
  const TempDir folder;
  const std::string node = folder.write("dev/video0", "").string();
  std::filesystem::create_directories(folder / "dev/v4l/by-id");
  const std::string link = (folder / "dev/v4l/by-id/usb-Webcam").string();
  std::filesystem::create_symlink(node, link);
  const V4l2Paths paths{(folder / "dev").string(), (folder / "sys").string(), "/proc"};
  CameraListing listing = listing_of(node);
  listing.links = {link};
  CameraConfig camera;
  camera.path = link;
  const FoundCamera by_link = find_v4l2_camera(camera, {listing}, paths);
  ASSERT_TRUE(by_link.listing);
  EXPECT_EQ(worst(by_link.findings), Level::kOk) << text(by_link.findings);
  camera.path = node;
  const FoundCamera by_node = find_v4l2_camera(camera, {listing}, paths);
  EXPECT_TRUE(by_node.listing);
  EXPECT_THAT(text(by_node.findings), HasSubstr("set camera.path = \"" + link + "\""));
}

TEST(DoctorCamera, SaysWhatIsMissing) {
  const TempDir folder;
  const std::string other = folder.write("dev/video1", "").string();
  const V4l2Paths paths{(folder / "dev").string(), (folder / "sys").string(), "/proc"};
  CameraConfig camera;
  const auto problem = [&](const std::string& path) {
    camera.path = path;
    const FoundCamera found = find_v4l2_camera(camera, {}, paths);
    EXPECT_FALSE(found.listing);
    EXPECT_EQ(worst(found.findings), Level::kProblem);
    return text(found.findings);
  };
  EXPECT_THAT(problem((folder / "dev/video7").string()), HasSubstr("video7 is not there"));
  EXPECT_THAT(problem("serial:SN9"), HasSubstr("no camera has the serial number SN9"));
  EXPECT_THAT(problem(other), HasSubstr("no node that images can be captured from"));
}

TEST(DoctorCamera, OnlyTheDaemonItselfMayHaveIt) {
  const auto judged = [](const CameraUse& use) { return judge_use("/dev/video0", use); };
  EXPECT_TRUE(judged({}).free);
  EXPECT_THAT(judged({}).findings, IsEmpty());
  EXPECT_EQ(worst(judged({"busy", "process 12 (loopd)", 12, false}).findings), Level::kOk);
  EXPECT_EQ(worst(judged({"busy", "process 12 (loopd)", 0, false}).findings), Level::kOk);
  EXPECT_EQ(worst(judged({"busy", "", 0, true}).findings), Level::kOk) << "not seen, but it works";
  EXPECT_EQ(worst(judged({"busy", "", 0, false}).findings), Level::kProblem);
  EXPECT_EQ(worst(judged({"busy", "process 12 (loopd)", 11, false}).findings), Level::kProblem)
      << "another loopd than the service's";
  EXPECT_EQ(worst(judged({"busy", "process 12 (loopd), process 13 (obs)", 12, true}).findings),
            Level::kProblem);
  EXPECT_EQ(worst(judged({"", "process 13 (obs)", 12, false}).findings), Level::kWarning);
  for (const CameraUse& use :
       {CameraUse{"busy", "", 0, true}, CameraUse{"", "process 1 (x)", 0, false}})
    EXPECT_FALSE(judged(use).free);
}

V4l2Mode mode(const std::string& code, std::vector<V4l2Size> sizes) {
  V4l2Mode result;
  for (std::size_t i = 0; i < 4; ++i) result.fourcc |= static_cast<std::uint32_t>(code[i]) << 8 * i;
  result.format = pixel_format_from_fourcc(result.fourcc);
  result.sizes = std::move(sizes);
  return result;
}

TEST(DoctorCamera, ComparesWithWhatTheCameraOffers) {
  const std::vector<V4l2Mode> modes = {mode("YUYV", {{640, 480, {30}}, {1280, 720, {10}}}),
                                       mode("MJPG", {{1280, 720, {30}}}), mode("H264", {})};
  CameraConfig camera;
  camera.width = 1280;
  camera.height = 720;
  camera.fps = 30;
  EXPECT_THAT(text(judge_modes(camera, modes)),
              HasSubstr("ok       camera: it gives 1280x720 at up "
                        "to 30 frames/s in YUYV, MJPG"));
  camera.format = "YUYV";
  EXPECT_THAT(text(judge_modes(camera, modes)),
              HasSubstr("warning  camera: at 1280x720 it gives at most 10 frames/s, not 30"));
  camera.width = 800;
  camera.height = 600;
  EXPECT_THAT(text(judge_modes(camera, modes)), HasSubstr("it has no 800x600 but 640x480"));
  camera.format = "NV12";
  EXPECT_THAT(text(judge_modes(camera, modes)),
              HasSubstr("PROBLEM  camera: it has no format NV12 but YUYV, MJPG, H264"));
  camera.format = "auto";
  EXPECT_EQ(worst(judge_modes(camera, {mode("H264", {})})), Level::kProblem);
  EXPECT_EQ(worst(judge_modes(camera, {})), Level::kSkipped);
}

TEST(DoctorCamera, LibcameraPathsAreParts) {
  const CameraListing first = listing_of("/base/imx219@10");
  const CameraListing second = listing_of("/base/imx219@20");
  CameraConfig camera;
  const auto found = [&](const std::string& path, const std::vector<CameraListing>& listings) {
    camera.path = path;
    return find_libcamera_camera(camera, listings);
  };
  ASSERT_TRUE(found("@20", {first, second}).listing);
  EXPECT_EQ(found("@20", {first, second}).listing->node, second.node);
  EXPECT_EQ(worst(found("@20", {first, second}).findings), Level::kOk);
  EXPECT_EQ(worst(found("Webcam", {first}).findings), Level::kOk);
  EXPECT_THAT(text(found("imx219", {first, second}).findings), HasSubstr("may mean 2 cameras"));
  EXPECT_EQ(worst(found("", {first}).findings), Level::kOk);
  for (const char* path : {"ov5647", ""}) {
    EXPECT_FALSE(found(path, {}).listing);
    EXPECT_EQ(worst(found(path, {}).findings), Level::kProblem);
  }
}

// --- trial

/// Gives what it is told to, then the end.
class ScriptedCamera : public Camera {
 public:
  void add_frame(std::uint8_t first, std::uint8_t second, int width_px = 64, int height_px = 16) {
    Frame frame;
    frame.buffer = pool_.acquire();
    frame.width_px = frame.stride_bytes = width_px;
    frame.height_px = height_px;
    for (int i = 0; i < width_px * height_px; ++i)
      frame.buffer[static_cast<std::size_t>(i)] = i % 16 < 8 ? first : second;
    events_.push_back(std::move(frame));
  }
  void add(CameraEvent event) { events_.push_back(std::move(event)); }

  CameraEvent next() override {
    if (events_.empty()) return EndOfStream{};
    CameraEvent event = std::move(events_.front());
    events_.pop_front();
    return event;
  }
  void interrupt() override {}
  std::string describe() const override { return "scripted"; }
  std::uint64_t restamped() const override { return 0; }

 private:
  FramePool pool_{32, 1024};
  std::deque<CameraEvent> events_;
};

constexpr std::chrono::minutes kLong{1};

CameraConfig live_config() {
  CameraConfig config;
  config.source = "v4l2";
  return config;
}

TEST(DoctorTrial, CountsWhatComes) {
  ScriptedCamera camera;
  camera.add(CameraNotice{CameraNotice::Kind::kOpened, "opened it"});
  camera.add(CameraNotice{CameraNotice::Kind::kSettings, "gain is not known"});
  camera.add(CameraNotice{CameraNotice::Kind::kTimeStamps, "stamps lie in the future"});
  camera.add(CameraError{CameraFault::kCorruptFrame, "short", 0, false, 0});
  for (int i = 0; i < 3; ++i) camera.add_frame(40, 200);
  const Trial trial = try_out(camera, 45, kLong);
  EXPECT_EQ(trial.frames, 3u);
  EXPECT_EQ(trial.corrupt, 1u);
  EXPECT_EQ(trial.width_px, 64);
  ASSERT_TRUE(trial.look);
  EXPECT_NEAR(trial.look->mean, 120, 1e-9);
  EXPECT_NEAR(trial.look->deviation, 80, 1e-9);
  const Findings findings = judge_trial(trial, live_config());
  EXPECT_EQ(worst(findings), Level::kWarning);
  EXPECT_THAT(text(findings),
              AllOf(HasSubstr("ok       trial: 3 images of 64x16: opened it"),
                    HasSubstr("gain is not known"), HasSubstr("stamps lie in the future"),
                    HasSubstr("1 of 4 frames were damaged"), HasSubstr("contrast 80")));
}

TEST(DoctorTrial, StopsAtTheWishedNumberOfFrames) {
  ScriptedCamera camera;
  for (int i = 0; i < 4; ++i) camera.add_frame(40, 200);
  EXPECT_EQ(try_out(camera, 3, kLong).frames, 3u);
  EXPECT_EQ(try_out(camera, 3, std::chrono::milliseconds(0)).frames, 0u) << "no time, no frame";
}

TEST(DoctorTrial, NoFrameIsAProblemWithItsCause) {
  ScriptedCamera camera;
  camera.add(CameraError{CameraFault::kStalled, "no frame for 1 s; look at the cable", 0, true, 0});
  const Findings findings = judge_trial(try_out(camera, 45, kLong), live_config());
  EXPECT_EQ(worst(findings), Level::kProblem);
  EXPECT_THAT(text(findings), HasSubstr("no frame for 1 s; look at the cable"));
  EXPECT_EQ(worst(judge_trial(Trial{}, live_config())), Level::kProblem);
}

TEST(DoctorTrial, LooksAtTheImages) {
  const auto look = [](std::uint8_t first, std::uint8_t second) {
    ScriptedCamera camera;
    camera.add_frame(first, second);
    return text(judge_trial(try_out(camera, 1, kLong), live_config()));
  };
  EXPECT_THAT(look(0, 4), AllOf(HasSubstr("black"), HasSubstr("lens cap")));
  EXPECT_THAT(look(255, 255), AllOf(HasSubstr("white"), HasSubstr("exposure")));
  EXPECT_THAT(look(90, 92), HasSubstr("all pixels are alike"));
  EXPECT_THAT(look(90, 150), Not(HasSubstr("warning  image")));
}

TEST(DoctorTrial, ComparesTheRateWithTheWish) {
  Trial trial;
  trial.frames = 45;
  trial.rate_hz = 12;
  CameraConfig config = live_config();
  EXPECT_EQ(worst(judge_trial(trial, config)), Level::kOk) << "no wish";
  config.fps = 30;
  EXPECT_THAT(text(judge_trial(trial, config)), HasSubstr("12.0 frames/s come, not 30.0"));
  trial.rate_hz = 29;
  EXPECT_EQ(worst(judge_trial(trial, config)), Level::kOk);
}

// --- threads

TEST(DoctorThreads, ReadsListsOfCpus) {
  EXPECT_THAT(parse_cpu_list("0-2,5\n"), ElementsAre(0, 1, 2, 5));
  EXPECT_THAT(parse_cpu_list("3 4"), ElementsAre(3, 4));
  EXPECT_THAT(parse_cpu_list(""), IsEmpty());
  EXPECT_THAT(parse_cpu_list("1,x"), ElementsAre(1));
  EXPECT_THAT(parse_cpu_list("2-"), IsEmpty());
  EXPECT_THAT(parse_cpu_list("-3,99999999999"), IsEmpty());
}

CpuLimits four_cpus() {
  CpuLimits limits;
  limits.online = {0, 1, 2, 3};
  limits.highest_priority = 50;
  return limits;
}

TEST(DoctorThreads, AllThatCanBeHadIsFine) {
  ThreadsConfig threads;
  threads.detect_cpus = {2};
  threads.capture_priority = 50;
  EXPECT_EQ(text(judge_threads(threads, four_cpus())),
            "ok       threads: capture on any CPU with priority 50, detect on CPU 2, lines on any "
            "CPU, main on any CPU\nall is well\n");
}

TEST(DoctorThreads, WhatCannotBeHadIsAProblemOnlyIfRequired) {
  ThreadsConfig threads;
  threads.detect_cpus = {3, 4};
  threads.main_priority = 60;
  const Findings findings = judge_threads(threads, four_cpus());
  EXPECT_EQ(worst(findings), Level::kWarning);
  EXPECT_THAT(text(findings),
              AllOf(HasSubstr("threads.detect_cpus names CPU 4"),
                    HasSubstr("threads.main_priority = 60"), HasSubstr("LimitRTPRIO=60")));
  threads.required = true;
  EXPECT_EQ(worst(judge_threads(threads, four_cpus())), Level::kProblem);
  CpuLimits by_user = four_cpus();
  by_user.by_unit = false;
  EXPECT_THAT(text(judge_threads(threads, by_user)), HasSubstr("limits.conf"));
  CpuLimits unlimited = four_cpus();
  unlimited.highest_priority.reset();
  threads.detect_cpus = {};
  EXPECT_EQ(worst(judge_threads(threads, unlimited)), Level::kOk);
}

TEST(DoctorThreads, TheUnitMayBarCpus) {
  ThreadsConfig threads;
  threads.capture_cpus = {0, 2};
  CpuLimits limits = four_cpus();
  limits.allowed = {2, 3};
  EXPECT_THAT(text(judge_threads(threads, limits)),
              HasSubstr("threads.capture_cpus names CPU 0, which AllowedCPUs="));
}

TEST(DoctorThreads, IsolatedCpusAreToBeUsedOneAThread) {
  ThreadsConfig threads;
  CpuLimits limits = four_cpus();
  limits.isolated = {2, 3};
  EXPECT_THAT(text(judge_threads(threads, limits)), HasSubstr("CPU 2,3 is isolated and not used"));
  threads.detect_cpus = {2, 3};
  EXPECT_THAT(text(judge_threads(threads, limits)), HasSubstr("uses only the first"));
  threads.detect_cpus = {2};
  threads.lines_cpus = {2};
  EXPECT_THAT(text(judge_threads(threads, limits)), HasSubstr("points and lines share CPU 2"));
  threads.lines_cpus = {3};
  EXPECT_EQ(worst(judge_threads(threads, limits)), Level::kOk);
}

// --- unit

CameraUnits running_units() {
  return {UnitProperties("LoadState=loaded\nUnitFileState=enabled\nActiveState=active\n"
                         "NRestarts=0\nStatusText=running\nDevicePolicy=closed\n"
                         "DeviceAllow=char-video4linux rw\nDeviceAllow=char-media rw\n"),
          UnitProperties("LoadState=loaded\nActiveState=active\n")};
}

TEST(DoctorUnit, ReadsWhatSystemctlPrints) {
  const UnitProperties properties(
      "A=1\nB=x=y\nnoise\nD=p q\nD=r\nM=infinity\nN=[not set]\n"
      "L=18446744073709551615\nlast=7");
  EXPECT_EQ(properties.get("B"), "x=y");
  EXPECT_EQ(properties.get("D"), "p q\nr");
  EXPECT_EQ(properties.get("absent"), "");
  EXPECT_EQ(properties.number("A"), 1u);
  EXPECT_EQ(properties.number("last"), 7u);
  for (const char* none : {"B", "M", "N", "L", "absent"})
    EXPECT_FALSE(properties.number(none)) << none;
  EXPECT_FALSE(UnitProperties().installed());
}

TEST(DoctorUnit, ARunningUnitIsFine) {
  const Findings findings = judge_units("front", running_units(), "libcamera");
  EXPECT_EQ(worst(findings), Level::kOk) << text(findings);
  EXPECT_THAT(text(findings), HasSubstr("loopd@front runs: running"));
}

TEST(DoctorUnit, WhatKeepsItFromRunningIsSaid) {
  const auto judged = [](const std::string& service) {
    return text(judge_units("front", {UnitProperties(service), {}}, "v4l2"));
  };
  EXPECT_THAT(judged("LoadState=not-found\n"),
              HasSubstr("warning  unit: the unit loopd@.service is "
                        "not installed"));
  EXPECT_THAT(judged("LoadState=loaded\nActiveState=failed\nResult=watchdog\nExecMainStatus=6\n"),
              AllOf(HasSubstr("PROBLEM  unit: loopd@front has failed (watchdog, exit status 6)"),
                    HasSubstr("journalctl -u loopd@front"), HasSubstr("enable --now loopd@front")));
  EXPECT_THAT(judged("LoadState=loaded\nUnitFileState=masked\nActiveState=inactive\n"),
              AllOf(HasSubstr("PROBLEM  unit: loopd@front is masked"),
                    HasSubstr("systemctl start loopd@front")));
  EXPECT_THAT(judged("LoadState=loaded\nActiveState=active\nNRestarts=3\nNeedDaemonReload=yes\n"),
              AllOf(HasSubstr("restarted by systemd 3 times"), HasSubstr("daemon-reload")));
}

TEST(DoctorUnit, TheSandboxMustLetTheCameraThrough) {
  const auto judged = [](const std::string& devices, const std::string& source) {
    const std::string service =
        "LoadState=loaded\nUnitFileState=enabled\nActiveState=active\n" + devices;
    return worst(judge_units("front", {UnitProperties(service), {}}, source));
  };
  EXPECT_EQ(judged("DevicePolicy=auto\n", "v4l2"), Level::kOk);
  EXPECT_EQ(judged("DevicePolicy=closed\n", "v4l2"), Level::kProblem);
  EXPECT_EQ(judged("DevicePolicy=closed\n", "file"), Level::kOk);
  EXPECT_EQ(judged("DevicePolicy=auto\nDeviceAllow=char-video4linux rw\n", "v4l2"), Level::kOk);
  EXPECT_EQ(judged("DevicePolicy=auto\nDeviceAllow=char-video4linux rw\n", "libcamera"),
            Level::kProblem);
  EXPECT_EQ(judged("DevicePolicy=closed\nDeviceAllow=/dev/video0 rw\n", "v4l2"), Level::kOk);
}

// --- sockets and daemon

TEST(DoctorDaemon, SocketsHaveTheRightModes) {
  const auto judged = [](bool control, mode_t mode) {
    return judge_socket_file({"/r/s", control, true, Ownership{0, 9, mode, "loopd"}});
  };
  EXPECT_EQ(worst(judged(false, S_IFSOCK | 0666)), Level::kOk);
  EXPECT_EQ(worst(judged(false, S_IFSOCK | 0660)), Level::kWarning);
  EXPECT_EQ(worst(judged(true, S_IFSOCK | 0660)), Level::kOk);
  EXPECT_THAT(text(judged(true, S_IFSOCK | 0660)), HasSubstr("for the group loopd only"));
  EXPECT_EQ(worst(judged(true, S_IFSOCK | 0666)), Level::kProblem);
  EXPECT_EQ(worst(judged(true, S_IFREG | 0660)), Level::kProblem);
  EXPECT_EQ(worst(judge_socket_file({"/r/s", false, true, std::nullopt})), Level::kProblem);
  EXPECT_THAT(judge_socket_file({"/r/s", false, false, std::nullopt}), IsEmpty());
}

Snapshot snapshot(const std::string& state, const std::string& stats = "{}") {
  return {Json{{"version", "1.0"}, {"camera", "front"}}, parse_json(state), parse_json(stats)};
}

TEST(DoctorDaemon, StatesAreJudged) {
  const auto level = [](const std::string& state) {
    return worst(judge_daemon(snapshot("{\"state\":\"" + state + "\"}"), "1.0"));
  };
  for (const char* well : {"running", "camera_back", "map_reset", "starting", "camera_end"})
    EXPECT_EQ(level(well), Level::kOk) << well;
  EXPECT_EQ(level("paused"), Level::kWarning);
  for (const char* ill : {"camera_lost", "camera_stalled", "detector_error", "unheard_of"})
    EXPECT_EQ(level(ill), Level::kProblem) << ill;
  EXPECT_THAT(
      text(judge_daemon(snapshot(R"({"state":"camera_lost","cause":"gone","remedy":"plug it in"})"),
                        "1.0")),
      HasSubstr("PROBLEM  daemon: it is camera_lost: gone; plug it in"));
  EXPECT_EQ(worst(judge_daemon(snapshot("null"), "1.0")), Level::kWarning);
}

TEST(DoctorDaemon, AnotherVersionIsToBeStartedAnew) {
  EXPECT_THAT(
      text(judge_daemon(snapshot(R"({"state":"running"})"), "1.1")),
      AllOf(HasSubstr("loopd 1.0 runs, but loopctl is 1.1"), HasSubstr("restart loopd@front")));
}

TEST(DoctorDaemon, CountersAreComparedWithAllFrames) {
  const auto judged = [](const std::string& stats) {
    return text(judge_daemon(snapshot(R"({"state":"running"})", stats), "1.0"));
  };
  EXPECT_THAT(judged(R"({"frames":1000,"dropped":1000,"corrupt":5,"loops":3})"),
              AllOf(HasSubstr("1000 frames, 1000 dropped, 3 loops"), HasSubstr("all is well")));
  EXPECT_THAT(judged(R"({"frames":100,"dropped":900})"),
              HasSubstr("900 of 1000 frames were dropped, the detector is too slow"));
  EXPECT_THAT(judged(R"({"frames":90,"corrupt":10})"), HasSubstr("10 of 100 frames were damaged"));
  EXPECT_THAT(judged(R"({"frames":90,"restamped":80})"), HasSubstr("cannot be believed"));
  EXPECT_THAT(judged(R"({"frames":90,"errors":1})"), HasSubstr("failed in the detector"));
  EXPECT_THAT(judged(R"({"frames":90,"camera_losses":2})"), HasSubstr("camera was lost: 2"));
  EXPECT_THAT(judged(R"({"frames":90,"missed_records":4})"), HasSubstr("too slow for: 4"));
  EXPECT_THAT(judged(R"({"frames":"many","dropped":null})"), HasSubstr("all is well"));
}

}  // namespace
}  // namespace loopd::loopctl
