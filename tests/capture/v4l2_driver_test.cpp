// Finding, opening and setting V4L2 cameras over a fake kernel.

#include "capture/v4l2_driver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <string>
#include <vector>

#include "base/clock.h"
#include "capture/v4l2_controls.h"
#include "capture/v4l2_formats.h"
#include "capture/v4l2_list.h"
#include "support/v4l2_fixture.h"

namespace loopd {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using testing::FakeNode;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::V4l2Test;

class V4l2DriverTest : public V4l2Test {
 protected:
  // What is chosen for a wish, as "YUYV 640x480 30".
  std::string chosen(const V4l2Options& options) {
    const auto device = opened(options);
    if (!device) return "nothing";
    const DeviceInfo& info = device->info();
    return std::string(pixel_format_name(info.format)) + " " + std::to_string(info.width_px) + "x" +
           std::to_string(info.height_px) + " " + std::to_string(static_cast<int>(info.fps));
  }
};

TEST_F(V4l2DriverTest, TheCheapestFormatIsChosenAndUnreadableOnesAreNot) {
  camera().formats = {
      {V4L2_PIX_FMT_SRGGB8, {{640, 480, {30}}}}, {V4L2_PIX_FMT_MJPEG, {{640, 480, {30}}}},
      {V4L2_PIX_FMT_BGR24, {{640, 480, {30}}}},  {V4L2_PIX_FMT_Y16, {{640, 480, {30}}}},
      {V4L2_PIX_FMT_UYVY, {{640, 480, {30}}}},   {V4L2_PIX_FMT_YUV420, {{640, 480, {30}}}},
      {V4L2_PIX_FMT_GREY, {{640, 480, {30}}}}};
  const V4l2Options wish{.width_px = 640, .height_px = 480, .fps = 30};
  std::vector<std::string> order;
  for (; camera().formats.size() > 1; camera().formats.pop_back()) {
    order.push_back(chosen(wish).substr(0, 4));
    camera().format = {};
  }
  EXPECT_THAT(order, ElementsAre("GREY", "YU12", "UYVY", "Y16 ", "BGR3", "MJPG"));
  const CameraError error = open_error(wish);
  EXPECT_EQ(error.fault, CameraFault::kUnsupported);
  EXPECT_THAT(error.message, AllOf(HasSubstr("RGGB"), HasSubstr("libcamera")));
}

TEST_F(V4l2DriverTest, AFormatThatCannotReachSizeOrRateLosesToOneThatCan) {
  camera().formats = {
      {V4L2_PIX_FMT_YUYV, {{640, 480, {30, 15}}, {1280, 720, {5}}}},
      {V4L2_PIX_FMT_MJPEG, {{640, 480, {30}}, {1280, 720, {30}}, {1920, 1080, {30}}}}};
  EXPECT_EQ(chosen({.width_px = 640, .height_px = 480, .fps = 30}), "YUYV 640x480 30");
  EXPECT_EQ(chosen({.width_px = 1280, .height_px = 720, .fps = 30}), "MJPG 1280x720 30");
  EXPECT_EQ(chosen({.width_px = 1280, .height_px = 720, .fps = 5}), "YUYV 1280x720 5");
  EXPECT_EQ(chosen({.width_px = 1280, .height_px = 720}).substr(0, 13), "MJPG 1280x720")
      << "5 fps is too slow to be wished for";
  EXPECT_EQ(chosen({.width_px = 1920, .height_px = 1080, .fps = 30}), "MJPG 1920x1080 30");
  EXPECT_EQ(chosen({.width_px = 1280, .height_px = 720, .fps = 30, .format = "YUYV"}).substr(0, 13),
            "YUYV 1280x720");
}

TEST_F(V4l2DriverTest, WhatCouldNotBeHadIsAWarning) {
  camera().formats = {{V4L2_PIX_FMT_YUYV, {{640, 480, {30}}}}};
  camera().lie = [](unsigned long request, void* argument) {
    if (request == VIDIOC_S_PARM)
      static_cast<v4l2_streamparm*>(argument)->parm.capture.timeperframe = {1, 25};
  };
  const auto device = opened({.width_px = 800, .height_px = 600, .fps = 60});
  EXPECT_THAT(device->info().warnings, ElementsAre("the camera gives 640x480 instead of 800x600",
                                                   "the camera gives 25 fps instead of 60 fps"));
}

TEST_F(V4l2DriverTest, WithoutAWishTheDriversSizeAndRateStay) {
  camera().formats = {{V4L2_PIX_FMT_YUYV, {{640, 480, {30}}, {320, 240, {30}}}}};
  camera().format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  camera().format.fmt.pix = {};
  camera().format.fmt.pix.width = 320;
  camera().format.fmt.pix.pixelformat = V4L2_PIX_FMT_YUYV;
  camera().fps = 20;
  const auto device = opened();
  EXPECT_EQ(device->info().width_px, 320);
  EXPECT_EQ(device->info().fps, 20);
  EXPECT_THAT(device->info().warnings, IsEmpty());
  EXPECT_FALSE(kernel_.requests.contains(VIDIOC_S_PARM));
}

TEST_F(V4l2DriverTest, AFormatAskedForByNameIsThatOrAnError) {
  EXPECT_EQ(chosen({.format = "YUYV"}).substr(0, 4), "YUYV");
  CameraError error = open_error({.format = "MJPG"});
  EXPECT_EQ(error.fault, CameraFault::kUnsupported);
  EXPECT_THAT(error.message, AllOf(HasSubstr("MJPG"), HasSubstr("it offers YUYV")));
  error = open_error({.format = "H264"});
  EXPECT_EQ(error.fault, CameraFault::kUnsupported);
}

TEST_F(V4l2DriverTest, ListsWithoutEndAreCutOff) {
  camera().endless = true;
  const long before = kernel_.calls;
  open({.width_px = 8, .height_px = 4, .fps = 30});
  EXPECT_LT(kernel_.calls - before, 2'000'000);
}

TEST_F(V4l2DriverTest, ADriverThatListsNothingIsTakenAsItIsSet) {
  camera().faults[VIDIOC_ENUM_FMT] = {-ENOTTY, -1};
  camera().faults[VIDIOC_ENUM_FRAMESIZES] = {-ENOTTY, -1};
  EXPECT_EQ(chosen({}).substr(0, 8), "YUYV 8x4");
}

TEST_F(V4l2DriverTest, ALoopbackDeviceThatNothingFeedsHasNoSignal) {
  camera().faults[VIDIOC_G_FMT] = {-EINVAL, -1};
  const CameraError error = open_error();
  EXPECT_EQ(error.fault, CameraFault::kNoSignal);
  EXPECT_THAT(error.message, HasSubstr("feeds"));
}

TEST_F(V4l2DriverTest, SizesNoPictureHasAreRefused) {
  for (const std::uint32_t side : {0u, 65536u, 0xffffffffu}) {
    camera().lie = [=](unsigned long request, void* argument) {
      if (request == VIDIOC_S_FMT) static_cast<v4l2_format*>(argument)->fmt.pix.width = side;
    };
    EXPECT_EQ(open_error().fault, CameraFault::kUnsupported) << side;
  }
}

TEST_F(V4l2DriverTest, InterlacedFieldsAreAWarning) {
  camera().lie = [](unsigned long request, void* argument) {
    if (request == VIDIOC_S_FMT)
      static_cast<v4l2_format*>(argument)->fmt.pix.field = V4L2_FIELD_INTERLACED;
  };
  EXPECT_THAT(opened()->info().warnings, ElementsAre(HasSubstr("interlaced")));
}

TEST_F(V4l2DriverTest, SizesInStepsGiveTheNearestStep) {
  V4l2Mode mode;
  mode.range = V4l2SizeRange{16, 1920, 16, 16, 1080, 8};
  const auto nearest = [&](int width_px, int height_px) {
    const V4l2Size size = nearest_size(mode, {width_px, height_px, 0, {}});
    return std::to_string(size.width_px) + "x" + std::to_string(size.height_px);
  };
  EXPECT_EQ(nearest(640, 480), "640x480");
  EXPECT_EQ(nearest(650, 481), "656x480");
  EXPECT_EQ(nearest(1, 1), "16x16");
  EXPECT_EQ(nearest(65535, 65535), "1920x1080");
}

TEST_F(V4l2DriverTest, ControlsAreSetInOrderAndRefusalsAreWarnings) {
  camera().controls = {{"Auto Exposure", 0, 3},
                       {"Exposure Time, Absolute", 1, 5000, 0, V4L2_CTRL_FLAG_INACTIVE, -EACCES},
                       {"Gain", 0, 100},
                       {"White Balance, Automatic", 0, 1}};
  const auto device = opened({.controls = {{"auto_exposure", "1"},
                                           {"exposure_time_absolute", "200"},
                                           {"gain", "101"},
                                           {"gain", "ten"},
                                           {"Gain", "10"},
                                           {"white_balance_automatic", "true"},
                                           {"zoom", "1"}}});
  EXPECT_EQ(camera().controls[0].value, 1);
  EXPECT_EQ(camera().controls[2].value, 10);
  EXPECT_EQ(camera().controls[3].value, 1);
  EXPECT_THAT(device->info().warnings,
              ElementsAre(AllOf(HasSubstr("exposure_time_absolute to 200"), HasSubstr("inactive")),
                          HasSubstr("its range is 0 to 100"), HasSubstr("gain to ten"),
                          HasSubstr("no such control")));
}

TEST_F(V4l2DriverTest, ControlNamesAreThoseOfTheTools) {
  EXPECT_EQ(control_name("Exposure Time, Absolute"), "exposure_time_absolute");
  EXPECT_EQ(control_name("White Balance, Auto & Preset"), "white_balance_auto_preset");
  EXPECT_EQ(control_name("  Gain (dB) "), "gain_db");
  EXPECT_EQ(control_name(""), "");
}

TEST_F(V4l2DriverTest, ANodeThatIsNotThereIsNoDevice) {
  fs::remove(path());
  CameraError error = open_error();
  EXPECT_EQ(error.fault, CameraFault::kNoDevice);
  EXPECT_THAT(error.message, AllOf(HasSubstr(path()), HasSubstr("plug the camera in")));
  EXPECT_EQ(open_error({.camera = "serial:SN9"}).fault, CameraFault::kNoDevice);
}

TEST_F(V4l2DriverTest, EveryReasonNotToOpenIsNamedWithItsRemedy) {
  const std::vector<std::tuple<int, CameraFault, std::string>> reasons{
      {-ENOENT, CameraFault::kNoDevice, "plug the camera in"},
      {-ENXIO, CameraFault::kNoDevice, "plug the camera in"},
      {-ENODEV, CameraFault::kNoDevice, "plug the camera in"},
      {-EACCES, CameraFault::kPermission, "the group"},
      {-EPERM, CameraFault::kPermission, "DeviceAllow"},
      {-EBUSY, CameraFault::kBusy, "end that one"},
      {-ENOTTY, CameraFault::kUnsupported, "camera.path"},
      {-EMFILE, CameraFault::kStreamError, "descriptors"}};
  for (const auto& [result, fault, remedy] : reasons) {
    kernel_.open_results["video0"] = result;
    const CameraError error = open_error();
    EXPECT_EQ(error.fault, fault) << result;
    EXPECT_EQ(error.code, -result);
    EXPECT_THAT(error.message, AllOf(HasSubstr("cannot open " + path()), HasSubstr(remedy)));
  }
}

TEST_F(V4l2DriverTest, WhoKeepsItBusyIsNamed) {
  camera().busy = true;
  fs::create_directories(dir_ / "proc/4711/fd");
  dir_.write("proc/4711/comm", "guvcview\n");
  fs::create_symlink(path(), dir_ / "proc/4711/fd/7");
  const CameraError error = open_error();
  EXPECT_EQ(error.fault, CameraFault::kBusy);
  EXPECT_THAT(error.message, HasSubstr("process 4711 (guvcview)"));
}

TEST_F(V4l2DriverTest, AMetadataNodeIsRefusedAndTheRightOneNamed) {
  plug_in("video1", "usb1/1-1/1-1:1.0", 1).capabilities =
      V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING;
  CameraError error = open_error({.camera = path("video1")});
  EXPECT_EQ(error.fault, CameraFault::kUnsupported);
  EXPECT_THAT(error.message, AllOf(HasSubstr("metadata"), HasSubstr(path("video0"))));
  plug_in("video2", "platform/other").capabilities = V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_STREAMING;
  error = open_error({.camera = path("video2")});
  EXPECT_THAT(error.message, AllOf(HasSubstr("output"), HasSubstr("loopctl cameras")));
  camera().capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_READWRITE;
  EXPECT_EQ(open_error().fault, CameraFault::kUnsupported);
  EXPECT_EQ(kernel_.descriptors(), 0);
}

TEST_F(V4l2DriverTest, ADigitalInputIsLockedOnFirst) {
  camera().dv_timings = 0;
  opened();
  EXPECT_TRUE(kernel_.requests.contains(VIDIOC_S_DV_TIMINGS));
  for (const int result : {-ENOLINK, -ENOLCK, -ERANGE}) {
    camera().dv_timings = result;
    const CameraError error = open_error();
    EXPECT_EQ(error.fault, CameraFault::kNoSignal);
    EXPECT_THAT(error.message, HasSubstr("HDMI"));
  }
  camera().dv_timings = -ENODATA;
  opened();
}

TEST_F(V4l2DriverTest, ACameraIsFoundByItsSerialNumberWhateverItsNode) {
  make_usb("usb1/1-1", "0825", "SN0001");
  make_usb("usb1/1-2", "0825", "SN0002");
  plug_in("video5", "usb1/1-2/1-2:1.0", 1);
  plug_in("video7", "usb1/1-2/1-2:1.0", 0);
  EXPECT_EQ(opened({.camera = "serial:SN0002"})->info().node, path("video7"))
      << "the first of the device, not of the machine";
  EXPECT_EQ(opened({.camera = "serial:SN0001"})->info().node, path("video0"));
}

TEST_F(V4l2DriverTest, ALinkIsFollowed) {
  fs::create_directories(dir_ / "dev/v4l/by-id");
  fs::create_symlink("../../video0", dir_ / "dev/v4l/by-id/usb-Fake-index0");
  EXPECT_EQ(opened({.camera = path("v4l/by-id/usb-Fake-index0")})->info().node, path("video0"));
}

TEST_F(V4l2DriverTest, TheIdStaysWithTheCamera) {
  EXPECT_EQ(opened()->info().id, "platform:fake-Fake Camera") << "no USB device";
  make_usb("usb1/1-1", "0825", "SN0001");
  dir_.write("sys/devices/usb1/1-1/1-1:1.0/bInterfaceNumber", "00\n");
  const std::string id = opened()->info().id;
  EXPECT_EQ(id, "usb-046d:0825-SN0001-00");
  make_usb("usb1/1-4", "0825", "SN0001");
  dir_.write("sys/devices/usb1/1-4/1-4:1.0/bInterfaceNumber", "00\n");
  plug_in("video3", "usb1/1-4/1-4:1.0");
  EXPECT_EQ(opened({.camera = path("video3")})->info().id, id) << "at another port";
  make_usb("usb1/1-5", "0825", "");
  plug_in("video4", "usb1/1-5/1-5:1.0");
  EXPECT_EQ(opened({.camera = path("video4")})->info().id, "usb-046d:0825-port-1-5");
}

TEST_F(V4l2DriverTest, ChangesInDevWakeTheDriver) {
  const auto driver = make_v4l2_driver({.camera = path()}, kernel_, paths_);
  const Interrupt interrupt;
  const auto changed = [&] {
    return interrupt.wait_readable(driver->hotplug_fd(), monotonic_now_ns()) ==
           Interrupt::Ready::kReadable;
  };
  EXPECT_FALSE(changed());
  dir_.write("dev/video1", "");
  EXPECT_TRUE(changed());
  driver->acknowledge();
  EXPECT_FALSE(changed());
  fs::permissions(path(), fs::perms::owner_read);
  EXPECT_TRUE(changed()) << "its permissions";
  fs::create_directories(dir_ / "dev/v4l/by-id");
  driver->acknowledge();
  fs::create_symlink("../../video0", dir_ / "dev/v4l/by-id/usb-Fake");
  EXPECT_TRUE(changed()) << "in a folder that was not there at first";
  driver->acknowledge();
  fs::remove(path());
  EXPECT_TRUE(changed());
}

TEST_F(V4l2DriverTest, TheListNamesWhatCanBeOpenedAndWhy) {
  make_usb("usb1/1-1", "0825", "SN0001");
  camera().formats = {{V4L2_PIX_FMT_YUYV, {{640, 480, {30, 15}}, {1280, 720, {10}}}},
                      {V4L2_PIX_FMT_SRGGB8, {{640, 480, {}}}}};
  fs::create_directories(dir_ / "dev/v4l/by-id");
  fs::create_symlink("../../video0", dir_ / "dev/v4l/by-id/usb-Fake-index0");
  plug_in("video1", "usb1/1-1/1-1:1.0", 1).capabilities = V4L2_CAP_META_CAPTURE;
  plug_in("video2", "platform/two").busy = true;
  plug_in("video10", "platform/ten");
  kernel_.open_results["video10"] = -EACCES;
  const std::vector<CameraListing> list = list_v4l2_cameras(kernel_, paths_);
  ASSERT_EQ(list.size(), 3u);
  EXPECT_EQ(list[0].node, path("video0"));
  EXPECT_THAT(list[0].links, ElementsAre(path("v4l/by-id/usb-Fake-index0")));
  EXPECT_EQ(list[0].name, "Fake Camera");
  EXPECT_EQ(list[0].serial, "SN0001");
  EXPECT_EQ(list[0].id, "usb-046d:0825-SN0001");
  EXPECT_EQ(list[0].problem, "");
  ASSERT_EQ(list[0].modes.size(), 2u);
  EXPECT_EQ(mode_text(list[0].modes[0]), "YUYV  640x480 (30, 15 fps), 1280x720 (10 fps)");
  EXPECT_EQ(mode_text(list[0].modes[1]), "RGGB  640x480");
  EXPECT_EQ(list[0].modes[1].format, std::nullopt);
  EXPECT_EQ(list[1].node, path("video2"));
  EXPECT_THAT(list[1].problem, HasSubstr("busy"));
  EXPECT_EQ(list[2].node, path("video10"));
  EXPECT_THAT(list[2].problem, HasSubstr("Permission denied"));
  EXPECT_EQ(kernel_.descriptors(), 0);
}

TEST_F(V4l2DriverTest, AFileThatIsNoVideoNodeIsNotOpened) {
  const auto driver = make_v4l2_driver({.camera = dir_.write("file", "x").string()});
  CaptureDriver::Opened result = driver->open();
  ASSERT_TRUE(std::holds_alternative<CameraError>(result));
  EXPECT_EQ(std::get<CameraError>(result).fault, CameraFault::kUnsupported);
}

}  // namespace
}  // namespace loopd
