// What loopctl says, apart from any daemon or device.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>

#include "app/config_file.h"
#include "loopctl/cameras.h"
#include "loopctl/control.h"
#include "loopctl/finding.h"
#include "loopctl/record.h"
#include "loopctl/render.h"
#include "support/temp_dir.h"

namespace loopd::loopctl {
namespace {

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::TempDir;

TEST(LoopctlText, StatesCarryTheFaultsName) {
  const Json lost = parse_json(
      R"({"class":"state","state":"camera_lost","fault":"busy","cause":"in use","remedy":"end it"})");
  EXPECT_EQ(record_line(lost), "STATE camera_lost (busy): in use [end it]");
  EXPECT_EQ(record_line(parse_json(R"({"class":"state","state":"paused"})")), "STATE paused");
  EXPECT_THAT(status_block(Json(), lost, Json(), "/s"),
              AllOf(HasSubstr("fault     busy"), HasSubstr("cause     in use")));
}

TEST(LoopctlText, StatusTellsOfLossesOnlyWhereThereWereSome) {
  const Json well = parse_json(R"({"frames":5,"camera_losses":0,"restamped":0})");
  EXPECT_THAT(status_block(Json(), Json(), well, "/s"), Not(HasSubstr("lost")));
  const Json ill = parse_json(R"({"frames":5,"camera_losses":2,"restamped":3})");
  EXPECT_THAT(status_block(Json(), Json(), ill, "/s"),
              HasSubstr("lost 2 times, 3 frames with a replaced time"));
}

TEST(LoopctlText, GapsTellWhatIsKnownOfThem) {
  EXPECT_EQ(record_line(parse_json(R"({"class":"gap","count":3,"first":4,"last":9})")),
            "GAP 3 records missed (seq 4 to 9): this reader was too slow");
  EXPECT_EQ(record_line(parse_json(R"({"class":"gap","of_epoch":"e1"})")),
            "GAP some records missed of epoch e1");
}

TEST(LoopctlText, AnswersOfControlAreSentences) {
  EXPECT_EQ(done_text(ControlOp::kReload, R"({"class":"ok","op":"reload","result":"camera.fps"})"),
            "camera.fps");
  EXPECT_THAT(done_text(ControlOp::kPause, R"({"class":"ok"})"), HasSubstr("loopctl resume"));
  EXPECT_EQ(done_text(ControlOp::kResume, "no JSON"), "resumed");
  EXPECT_THAT(done_text(ControlOp::kReset, "{}"), HasSubstr("new epoch"));
}

TEST(LoopctlText, WhoMayNotControlIsToldHowTo) {
  EXPECT_EQ(permission_remedy("ada", "loopd"),
            "join the group loopd: sudo usermod -aG loopd ada, then log in again");
  EXPECT_THAT(permission_remedy("ada", std::nullopt), HasSubstr("usermod -aG loopd ada"));
  EXPECT_THAT(permission_remedy("ada", "robots"), HasSubstr("usermod -aG robots ada"));
  EXPECT_THAT(permission_remedy("ada", "root"), AllOf(HasSubstr("sudo"), Not(HasSubstr("join"))));
}

TEST(LoopctlText, ARecordingIsCompleteOnlyWithEveryFrameUntilAnEndInOrder) {
  const auto recorded = [](const char* reason, int lost, int frames = 7) {
    return Json{{"class", "recorded"},
                {"frames", frames},
                {"bytes", 1 << 20},
                {"lost", lost},
                {"reason", reason}};
  };
  for (const char* reason : {"stopped", "time", "size", "frames"}) {
    EXPECT_TRUE(is_complete(recorded(reason, 0))) << reason;
    EXPECT_FALSE(is_complete(recorded(reason, 1))) << reason;
    EXPECT_FALSE(is_complete(recorded(reason, 0, 0))) << reason;
  }
  EXPECT_FALSE(is_complete(recorded("disk_full", 0)));
  EXPECT_FALSE(is_complete(recorded("write_error", 0)));
  EXPECT_FALSE(is_complete(Json()));
  EXPECT_EQ(recorded_text(recorded("time", 0), "a.rec"),
            "recorded 7 frames, 1.0 MiB, in a.rec: its time is over");
  EXPECT_THAT(recorded_text(recorded("stopped", 2), "a"), HasSubstr("2 frames are missing"));
  EXPECT_THAT(recorded_text(recorded("stopped", 0, 0), "a"), HasSubstr("gave no image"));
  Json full = recorded("disk_full", 0);
  full["message"] = "no room\non the disk";
  EXPECT_THAT(recorded_text(full, "a"), EndsWith("no room?on the disk"));
}

TEST(NewRecording, VanishesUnlessKept) {
  const TempDir folder;
  const std::string path = (folder / "a.rec").string();
  ASSERT_TRUE(NewRecording::create(path, false).ok());
  EXPECT_FALSE(std::filesystem::exists(path));
  {
    Result<NewRecording> file = NewRecording::create(path, false);
    ASSERT_TRUE(file.ok());
    EXPECT_TRUE(file->keep().ok());
  }
  EXPECT_TRUE(std::filesystem::exists(path));
}

TEST(NewRecording, ReplacesOnlyWhenToldToAndOnlyOnceKept) {
  const TempDir folder;
  const std::string path = folder.write("a.rec", "old").string();
  const Result<NewRecording> refused = NewRecording::create(path, false);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, AllOf(HasSubstr(path), HasSubstr("--force")));
  {
    const Result<NewRecording> file = NewRecording::create(path, true);
    ASSERT_TRUE(file.ok());
  }
  EXPECT_EQ(std::filesystem::file_size(path), 3u) << "given up: the old one is as it was";
  Result<NewRecording> file = NewRecording::create(path, true);
  ASSERT_TRUE(file.ok());
  ASSERT_EQ(write(file->fd(), "newer", 5), 5);
  EXPECT_TRUE(file->keep().ok());
  EXPECT_EQ(std::filesystem::file_size(path), 5u);
  const auto entries = std::filesystem::directory_iterator(folder.path());
  EXPECT_EQ(std::distance(begin(entries), end(entries)), 1) << "nothing is left beside it";
}

TEST(NewRecording, NeverReplacesWhatIsNoFile) {
  const TempDir folder;
  std::filesystem::create_symlink("/dev/null", folder / "link");
  for (const std::string& path :
       {std::string("/dev/null"), (folder / "link").string(), folder.string()}) {
    const Result<NewRecording> file = NewRecording::create(path, true);
    ASSERT_FALSE(file.ok()) << path;
    EXPECT_THAT(file.error().message, HasSubstr("no regular file"));
  }
  EXPECT_FALSE(NewRecording::create((folder / "none/a.rec").string(), false).ok());
}

CameraListing listing(const std::string& node, const std::string& bus,
                      const std::string& serial = {}) {
  CameraListing camera;
  camera.node = node;
  camera.bus = bus;
  camera.name = "Webcam";
  camera.driver = "uvcvideo";
  camera.serial = serial;
  return camera;
}

TEST(Cameras, TheBestPathIsTheMostLastingOne) {
  CameraListing camera = listing("/dev/video0", "usb-1");
  EXPECT_EQ(best_path(camera, {camera}), "/dev/video0");
  camera.serial = "SN1";
  EXPECT_EQ(best_path(camera, {camera}), "serial:SN1");
  camera.links = {"/dev/v4l/by-id/usb-Webcam_SN1-video-index0", "/dev/v4l/by-path/pci-usb-1"};
  EXPECT_EQ(best_path(camera, {camera}), camera.links[0]);
  const CameraListing second_node = listing("/dev/video1", "usb-1", "SN1");
  EXPECT_EQ(best_path(camera, {camera, second_node}), camera.links[0]) << "the same camera's";
  const CameraListing other = listing("/dev/video2", "usb-2", "SN2");
  EXPECT_EQ(best_path(camera, {camera, other}), camera.links[0]);
}

TEST(Cameras, TwinsAreToldApartByTheirPorts) {
  CameraListing camera = listing("/dev/video0", "usb-1", "0001");
  camera.links = {"/dev/v4l/by-id/usb-Webcam_0001-video-index0", "/dev/v4l/by-path/pci-usb-1"};
  const CameraListing twin = listing("/dev/video2", "usb-2", "0001");
  EXPECT_EQ(best_path(camera, {camera, twin}), "/dev/v4l/by-path/pci-usb-1");
  EXPECT_EQ(best_path(twin, {camera, twin}), "/dev/video2");
}

TEST(Cameras, TheSnippetIsAConfigThatChoosesTheCamera) {
  const LoadedConfig loaded = parse_config(config_snippet("v4l2", R"(/dev/a "b" \c)"), "s", {});
  ASSERT_TRUE(loaded.ok()) << loaded.mistakes.front();
  EXPECT_EQ(loaded.config.camera.source, "v4l2");
  EXPECT_EQ(loaded.config.camera.path, R"(/dev/a "b" \c)");
}

CameraList two_cameras() {
  CameraList list;
  list.v4l2 = {listing("/dev/video0", "usb-1", "SN1")};
  V4l2Mode yuyv;
  yuyv.fourcc = 0x56595559;
  yuyv.format = PixelFormat::kYuyv;
  yuyv.sizes = {{640, 480, {30, 15}}};
  V4l2Mode strange;
  strange.fourcc = 0x34363248;
  V4l2Mode uyvy = yuyv;
  uyvy.fourcc = 0x59565955;
  list.v4l2[0].modes = {yuyv, uyvy, strange};
  list.v4l2[0].problem = "it is in use by process 7 (obs)";
  list.build = {true, "libcamera 0.0.3"};
  CameraListing sensor;
  sensor.node = "/base/i2c/imx219@10";
  sensor.name = "imx219";
  list.libcamera = {sensor};
  return list;
}

TEST(Cameras, TextSaysHowEachIsChosenAndWhatIsInTheWay) {
  EXPECT_THAT(
      cameras_text(two_cameras()),
      AllOf(HasSubstr("/dev/video0: Webcam\n"), HasSubstr("YUYV, UYVY  640x480 (30, 15 fps)\n"),
            HasSubstr("  unread    H264\n"), HasSubstr("in use by process 7 (obs)"),
            HasSubstr("      path = \"serial:SN1\"\n"), HasSubstr("/base/i2c/imx219@10: imx219\n"),
            HasSubstr("      path = \"/base/i2c/imx219@10\"\n")));
}

TEST(Cameras, JsonHasTheSame) {
  const Json json = parse_json(dump(cameras_json(two_cameras())));
  ASSERT_EQ(json["cameras"].size(), 2u);
  EXPECT_EQ(json["cameras"][0]["path"], "serial:SN1");
  EXPECT_EQ(json["cameras"][0]["formats"][0]["sizes"][0]["fps"][1], 15);
  EXPECT_EQ(json["cameras"][0]["formats"][2]["readable"], false);
  EXPECT_EQ(json["cameras"][1]["source"], "libcamera");
}

TEST(Cameras, NoneIsSaidWithWhatToLookAt) {
  CameraList none;
  none.build = {false, "this build has no libcamera"};
  EXPECT_THAT(cameras_text(none), AllOf(HasSubstr("no camera found"), HasSubstr("lsusb"),
                                        HasSubstr("this build has no libcamera")));
}

TEST(Findings, AreLinesWithTheirRemedyAndACount) {
  const Findings findings = {Finding::ok("config", "valid"), Finding::skipped("unit", "no systemd"),
                             Finding::warning("trial", "slow\x1b[2J", "more light"),
                             Finding::problem("camera", "gone", "plug it in")};
  EXPECT_EQ(findings_text(findings),
            "ok       config: valid\n"
            "-        unit: not checked: no systemd\n"
            "warning  trial: slow?[2J; more light\n"
            "PROBLEM  camera: gone; plug it in\n"
            "1 problem, 1 warning\n");
  EXPECT_TRUE(has_problem(findings));
  EXPECT_EQ(findings_text({Finding::ok("a", "b")}), "ok       a: b\nall is well\n");
  const Json json = findings_json(findings);
  EXPECT_EQ(json["ok"], false);
  EXPECT_EQ(json["findings"][1]["level"], "skipped");
  EXPECT_EQ(json["findings"][3]["remedy"], "plug it in");
}

}  // namespace
}  // namespace loopd::loopctl
