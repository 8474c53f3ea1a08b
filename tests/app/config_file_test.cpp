#include "app/config_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "app/parameter_text.h"
#include "support/temp_dir.h"

namespace loopd {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

LoadedConfig from_text(std::string_view text, std::vector<std::string> sets = {}) {
  return parse_config(text, "t.toml", sets);
}

/// Every parameter's value as text, in order of the table.
std::vector<std::string> values_of(DaemonConfig config) {
  std::vector<std::string> values;
  for (const auto& row : daemon_parameters()) values.push_back(toml_value(row.ref(config)));
  return values;
}

/// Changes every value to another valid one, so that a round trip cannot succeed by defaults.
void change(const Parameter<DaemonConfig>& row, DaemonConfig& config) {
  const ParameterRef ref = row.ref(config);
  if (auto* const* value = std::get_if<bool*>(&ref)) **value = !**value;
  if (auto* const* value = std::get_if<int*>(&ref))
    **value = **value < row.max ? **value + 1 : **value - 1;
  if (auto* const* value = std::get_if<double*>(&ref)) **value = row.min + (row.max - row.min) / 3;
  if (auto* const* value = std::get_if<std::vector<int>*>(&ref)) **value = {0, 3, 1};
  static const std::map<std::string_view, std::string> bound_texts = {
      {"camera.source", "file"},
      {"camera.name", "rear-2"},
      {"camera.format", "NV12"},
      {"camera.controls", "gain=2 gamma=\"3\""}};
  auto* const* text = std::get_if<std::string*>(&ref);
  if (text == nullptr) return;
  const auto bound = bound_texts.find(row.key);
  **text = bound != bound_texts.end() ? bound->second : "a \"quoted\" \\ path/\xc3\xa9";
}

TEST(DaemonParameters, AreCompleteAndTheirDefaultsAreValid) {
  std::set<std::string_view> keys;
  DaemonConfig config;
  for (const auto& row : daemon_parameters()) {
    EXPECT_TRUE(keys.insert(row.key).second) << row.key << " is there twice";
    EXPECT_NE(row.key.find('.'), std::string_view::npos) << row.key;
    EXPECT_FALSE(row.reason.empty()) << row.key;
    EXPECT_LT(row.min, row.max) << row.key;
    EXPECT_EQ(range_violation(row.key, row.ref(config), row.min, row.max), std::nullopt);
  }
  EXPECT_GE(keys.size(), parameters().size() + 25);
  EXPECT_TRUE(keys.contains("features.points"));
  EXPECT_THAT(validate(DaemonConfig{}), IsEmpty());
}

TEST(DaemonParameters, DetectorRowsReachTheDetectorsConfig) {
  const LoadedConfig loaded = from_text("", {"verify.seed=7", "features.points=99"});
  EXPECT_TRUE(loaded.ok());
  EXPECT_EQ(loaded.config.detector.verify.seed, 7);
  EXPECT_EQ(loaded.config.detector.features.points, 99);
}

TEST(ConfigFile, ShippedFileIsTheTable) {
  const std::string path = LOOPD_SOURCE_DIR "/config/loopd.toml";
  std::ostringstream shipped;
  shipped << std::ifstream(path).rdbuf();
  EXPECT_EQ(shipped.str(), config_as_toml(DaemonConfig{}))
      << "regenerate it: build/release/src/app/loopd --print-config > config/loopd.toml";
}

TEST(ConfigFile, RoundTripKeepsEveryValue) {
  DaemonConfig config;
  for (const auto& row : daemon_parameters()) change(row, config);
  const LoadedConfig loaded = from_text(config_as_toml(config));
  EXPECT_THAT(loaded.mistakes, IsEmpty());
  EXPECT_EQ(values_of(loaded.config), values_of(config));
  EXPECT_NE(values_of(loaded.config), values_of(DaemonConfig{}));
}

TEST(ConfigFile, LinesOfThePrintedFileAreShort) {
  std::istringstream text(config_as_toml(DaemonConfig{}));
  for (std::string line; std::getline(text, line);) EXPECT_LE(line.size(), 100u) << line;
}

TEST(ConfigFile, TellsTenMistakesAtOnceInTheOrderOfTheFile) {
  const LoadedConfig loaded = from_text(
      "[camera]\n"
      "name = \"front door\"\n"  // 1: space
      "source = \"webcam\"\n"    // 2: not known
      "fps = -1\n"               // 3: below
      "buffers = 2.5\n"          // 4: type
      "exit_at_ned = true\n"     // 5: misspelt
      "[thread]\n"               // 6: misspelt section
      "lanes = 1\n"
      "[events]\n"
      "max_clients = 99999999999\n"  // 7: more than an int
      "[threads]\n"
      "detect_cpus = [0, 5000]\n"  // 8: element out of range
      "[features]\n"
      "points = 20000\n",         // 9: above
      {"verify.min_inlier=20"});  // 10: misspelt on the command line
  EXPECT_THAT(
      loaded.mistakes,
      ElementsAre(
          StartsWith("t.toml:2: camera.name = \"front door\". Violated constraint"),
          StartsWith("t.toml:3: camera.source = \"webcam\". Violated constraint"),
          "t.toml:4: camera.fps = -1.0. Violated constraint: camera.fps >= 0",
          "t.toml:5: camera.buffers expects a whole number, not a number with a fraction",
          "t.toml:6: there is no parameter camera.exit_at_ned; did you mean camera.exit_at_end?",
          "t.toml:7: there is no section [thread]; did you mean [threads]?",
          "t.toml:10: events.max_clients = 99999999999. Violated constraint: events.max_clients "
          "<= 1024",
          "t.toml:12: threads.detect_cpus = [0, 5000]. Violated constraint: threads.detect_cpus "
          "has only elements <= 1023",
          "t.toml:14: features.points = 20000. Violated constraint: features.points <= 10000",
          "--set: there is no parameter verify.min_inlier; did you mean verify.min_inliers?"));
}

TEST(ConfigFile, SyntaxErrorHasLineAndColumnAndHidesNoMistakeOfTheCommandLine) {
  const LoadedConfig loaded = from_text("[camera]\nfps = = 3\n", {"camera.fps=x"});
  EXPECT_THAT(loaded.mistakes, ElementsAre(StartsWith("t.toml:2:7: syntax: "),
                                           "--set: camera.fps expects a number, not \"x\""));
}

TEST(ConfigFile, KeysOutsideOfSectionsAndDoubleKeysAreMistakes) {
  EXPECT_THAT(from_text("points = 3\n").mistakes,
              ElementsAre("t.toml:1: there is no parameter points; did you mean "
                          "features.points?"));
  EXPECT_THAT(from_text("[camera]\nfps = 1\nfps = 2\n").mistakes,
              ElementsAre(StartsWith("t.toml:3:")));
  EXPECT_THAT(from_text("[features]\npoints.x = 1\n").mistakes,
              ElementsAre("t.toml:2: features.points expects a whole number, not a section"));
}

TEST(ConfigFile, EveryWrongTypeIsNamed) {
  EXPECT_THAT(from_text("[camera]\nloop = 1\npath = 3\nfps = true\nstart = 2020-01-01\n"
                        "[threads]\ndetect_cpus = 1\nlines_cpus = [\"a\"]\n")
                  .mistakes,
              ElementsAre("t.toml:2: camera.loop expects true or false, not a whole number",
                          "t.toml:3: camera.path expects text in quotes, not a whole number",
                          "t.toml:4: camera.fps expects a number, not true or false",
                          "t.toml:5: camera.start expects a whole number, not a date or time",
                          StartsWith("t.toml:7: threads.detect_cpus expects a list"),
                          StartsWith("t.toml:8: threads.lines_cpus expects a list")));
}

TEST(ConfigFile, NotANumberAndInfinityAreOutOfRange) {
  EXPECT_THAT(from_text("[camera]\nfps = nan\nnominal_fps = inf\n").mistakes,
              ElementsAre(StartsWith("t.toml:2: camera.fps = nan"),
                          StartsWith("t.toml:3: camera.nominal_fps = inf")));
}

TEST(ConfigFile, SetTakesTextWithoutQuotesAndListsWithoutBrackets) {
  const LoadedConfig loaded =
      from_text("[camera]\nfps = 5\n",
                {"camera.fps=12.5", "camera.path=/a b/\"c\"", "camera.name='x'", "camera.loop=true",
                 "threads.detect_cpus=0,1", "threads.lines_cpus=[2]", "threads.main_cpus="});
  EXPECT_THAT(loaded.mistakes, IsEmpty());
  EXPECT_EQ(loaded.config.camera.fps, 12.5);
  EXPECT_EQ(loaded.config.camera.path, "/a b/\"c\"");
  EXPECT_EQ(loaded.config.camera.name, "x");
  EXPECT_TRUE(loaded.config.camera.loop);
  EXPECT_THAT(loaded.config.threads.detect_cpus, ElementsAre(0, 1));
  EXPECT_THAT(loaded.config.threads.lines_cpus, ElementsAre(2));
  EXPECT_THAT(loaded.config.threads.main_cpus, IsEmpty());
}

TEST(ConfigFile, HostileSetsAreMistakes) {
  EXPECT_THAT(from_text("", {"nothing"}).mistakes,
              ElementsAre("--set: \"nothing\" is not of the form key=value"));
  EXPECT_THAT(from_text("", {"camera.fps=1\nother = 2"}).mistakes,
              ElementsAre(StartsWith("--set: camera.fps expects a number")));
  EXPECT_THAT(from_text("", {"camera.path=a\nb"}).mistakes,
              ElementsAre(HasSubstr("holds no control characters")));
  EXPECT_THAT(from_text("", {"=1", "camera.fps="}).mistakes.size(), 2u);
}

TEST(ConfigFile, BinaryAndDeeplyNestedTextIsAMistake) {
  EXPECT_THAT(from_text(std::string_view("\0\xff\xfe[", 4)).mistakes, ::testing::SizeIs(1));
  EXPECT_THAT(from_text("a = " + std::string(100'000, '[')).mistakes, ::testing::SizeIs(1));
}

TEST(ConfigFile, UnreadableFilesSayWhy) {
  const loopd::testing::TempDir folder;
  const auto mistakes = [](const std::string& path) { return load_config(path, {}).mistakes; };
  EXPECT_THAT(mistakes((folder / "absent").string()),
              ElementsAre(HasSubstr("absent: No such file or directory")));
  EXPECT_THAT(mistakes(folder.string()), ElementsAre(HasSubstr("Is a directory")));
  const auto large = folder.write("large.toml", std::string((1 << 20) + 1, '#'));
  EXPECT_THAT(mistakes(large.string()), ElementsAre(HasSubstr("more than 1 MiB")));
}

TEST(DaemonConfig, SocketPathFollowsTheCameraUnlessGiven) {
  DaemonConfig config;
  config.camera.name = "rear";
  EXPECT_EQ(event_socket_path(config), "/run/loopd/rear/events.sock");
  config.events.socket = "/tmp/x.sock";
  EXPECT_EQ(event_socket_path(config), "/tmp/x.sock");
}

TEST(DaemonConfig, OtherFilesFollowTheEventSocket) {
  DaemonConfig config;
  EXPECT_EQ(control_socket_path(config), "/run/loopd/front/control.sock");
  EXPECT_EQ(beside_event_socket(config, "ledger"), "/run/loopd/front/ledger");
  config.events.socket = "/tmp/walk.sock";
  EXPECT_EQ(control_socket_path(config), "/tmp/walk.control.sock");
  config.events.control_socket = "/tmp/c";
  EXPECT_EQ(control_socket_path(config), "/tmp/c");
}

TEST(DaemonConfig, ControlsAreTakenApart) {
  CameraConfig camera;
  EXPECT_THAT(camera_controls(camera), IsEmpty());
  camera.controls = "  gain=20 colour_gains=1.5,2  ";
  const std::vector<std::pair<std::string, std::string>> expected = {{"gain", "20"},
                                                                     {"colour_gains", "1.5,2"}};
  EXPECT_EQ(camera_controls(camera), expected);
}

TEST(DaemonConfig, WhatALiveCameraCannotHaveIsNamed) {
  DaemonConfig config;
  config.camera.source = "v4l2";
  EXPECT_THAT(validate(config), IsEmpty());
  EXPECT_THAT(missing_for_daemon(config), ElementsAre(HasSubstr("loopctl cameras")));
  config.camera.faults = "unplug@3:1s";
  config.camera.controls = "gain";
  EXPECT_THAT(validate(config), ElementsAre(HasSubstr("camera.controls = \"gain\""),
                                            HasSubstr("camera.faults = \"unplug@3:1s\"")));
  config.camera = CameraConfig();
  config.camera.source = "libcamera";
  EXPECT_THAT(missing_for_daemon(config), IsEmpty());
}

TEST(DaemonConfig, SocketPathTooLongForTheKernelIsNamed) {
  DaemonConfig config;
  config.events.socket = std::string(108, 'x');
  EXPECT_THAT(validate(config), ElementsAre(HasSubstr("events.socket is at most 107 bytes long "
                                                      "(it has 108)")));
}

TEST(DaemonConfig, OnlyTheDaemonNeedsACamera) {
  DaemonConfig config;
  EXPECT_THAT(validate(config), IsEmpty());
  EXPECT_THAT(missing_for_daemon(config), ElementsAre(StartsWith("camera.path is not set")));
  config.camera.path = "/data";
  EXPECT_THAT(missing_for_daemon(config), IsEmpty());
}

}  // namespace
}  // namespace loopd
