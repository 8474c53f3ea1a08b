// The file camera in lock-step: what it delivers, in which order, with which numbers and times.

#include "capture/file_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "support/camera_events.h"
#include "support/image_files.h"
#include "support/temp_dir.h"

namespace loopd {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::jpeg_file;
using testing::next_error;
using testing::next_events;
using testing::next_frame;
using testing::pgm_file;
using testing::png_file;
using testing::smooth_image;
using testing::TempDir;

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::size_t kMaxPixels = 64 * 48;

class FileCameraTest : public ::testing::Test {
 protected:
  // Images 000.pgm ... whose first pixel is their number.
  void write_images(int count, const std::string& folder = "") {
    for (int i = 0; i < count; ++i) {
      auto image = smooth_image(16, 12);
      image.data[0] = static_cast<std::uint8_t>(i);
      dir_.write(folder + name(i), pgm_file(image));
    }
  }

  static std::string name(int i) {
    const std::string digits = std::to_string(i);
    return std::string(3 - digits.size(), '0') + digits + ".pgm";
  }

  Result<std::unique_ptr<Camera>> try_open(FileCameraOptions options) {
    if (options.path.empty()) options.path = dir_.string();
    return open_file_camera(options, pool_);
  }

  std::unique_ptr<Camera> open(const FileCameraOptions& options = {}) {
    auto camera = try_open(options);
    EXPECT_TRUE(camera.ok()) << camera.error().message;
    return camera.ok() ? std::move(camera).value() : nullptr;
  }

  std::string open_error(const FileCameraOptions& options) {
    const auto camera = try_open(options);
    EXPECT_FALSE(camera.ok());
    return camera.ok() ? "" : camera.error().message;
  }

  TempDir dir_;
  FramePool pool_{2, kMaxPixels};
};

TEST_F(FileCameraTest, DeliversTheImagesInTheOrderOfTheirNamesAndThenTheEnd) {
  write_images(3);
  dir_.write("001.txt", "not an image");
  dir_.write("notes.md", "");
  const auto camera = open();
  for (int i = 0; i < 3; ++i) {
    const Frame frame = next_frame(*camera);
    EXPECT_EQ(frame.sequence, static_cast<std::uint64_t>(i));
    EXPECT_EQ(frame.buffer[0], i);
    EXPECT_EQ(frame.width_px, 16);
    EXPECT_EQ(frame.height_px, 12);
    EXPECT_EQ(frame.stride_bytes, 16);
    EXPECT_EQ(frame.time_ns, std::nullopt);
  }
  EXPECT_THAT(next_events(*camera, 3), ElementsAre("end", "end", "end"));
  EXPECT_EQ(camera->dropped(), 0u);
}

TEST_F(FileCameraTest, PixelsAreThoseOfTheFile) {
  const auto image = smooth_image(20, 10);
  dir_.write("a.png", png_file(image));
  const Frame frame = next_frame(*open());
  EXPECT_EQ(std::vector<std::uint8_t>(frame.buffer.get(), frame.buffer.get() + 200), image.data);
}

TEST_F(FileCameraTest, ADatasetFolderHoldsItsImagesInImages) {
  write_images(2, "images/");
  dir_.write("cover.png", png_file(smooth_image(3, 3)));
  EXPECT_THAT(next_events(*open(), 3), ElementsAre("frame 0", "frame 1", "end"));
}

TEST_F(FileCameraTest, OneImageIsAFolderOfOne) {
  write_images(1);
  const auto camera = open({.path = (dir_ / "000.pgm").string(), .loop = true});
  EXPECT_THAT(next_events(*camera, 3), ElementsAre("frame 0", "frame 1", "frame 2"));
}

TEST_F(FileCameraTest, ContentDecidesNotTheName) {
  dir_.write("a.jpg", png_file(smooth_image(8, 6)));
  dir_.write("b.png", jpeg_file(smooth_image(8, 6)));
  dir_.write("c.JPEG", pgm_file(smooth_image(8, 6)));
  dir_.write("d.ppm", "plain text");
  EXPECT_THAT(next_events(*open(), 5),
              ElementsAre("frame 0", "frame 1", "frame 2", "unsupported 3", "end"));
}

TEST_F(FileCameraTest, StartsWhereToldAndCountsOnWhenLooping) {
  write_images(3);
  EXPECT_THAT(next_events(*open({.start = 1}), 3), ElementsAre("frame 1", "frame 2", "end"));
  const auto camera = open({.loop = true, .start = 2});
  EXPECT_EQ(next_frame(*camera).buffer[0], 2);
  const Frame frame = next_frame(*camera);
  EXPECT_EQ(frame.sequence, 3u);
  EXPECT_EQ(frame.buffer[0], 0);
  EXPECT_THAT(open_error({.start = 3}), HasSubstr("has 3 frames"));
}

TEST_F(FileCameraTest, SizesMayChangeFromFrameToFrame) {
  dir_.write("0.pgm", pgm_file(smooth_image(1, 1)));
  dir_.write("1.png", png_file(smooth_image(64, 48, 3)));
  dir_.write("2.jpg", jpeg_file(smooth_image(30, 20)));
  const auto camera = open();
  EXPECT_EQ(next_frame(*camera).width_px, 1);
  EXPECT_EQ(next_frame(*camera).height_px, 48);
  EXPECT_EQ(next_frame(*camera).stride_bytes, 30);
}

TEST_F(FileCameraTest, ATooLargeImageCostsItsFrameAndNamesTheRemedy) {
  write_images(1);
  dir_.write("001.pgm", pgm_file(smooth_image(65, 48)));
  dir_.write("002.pgm", "P5 8000 6000 255\n");
  dir_.write("003.png", std::string(3'000'000, 'x'));
  dir_.write("004.pgm", pgm_file(smooth_image(64, 48)));
  const auto camera = open();
  next_frame(*camera);
  for (int i = 1; i <= 3; ++i) {
    const CameraError error = next_error(*camera);
    EXPECT_EQ(error.fault, CameraFault::kTooLarge);
    EXPECT_FALSE(error.lost);
    EXPECT_EQ(error.sequence, static_cast<std::uint64_t>(i));
    EXPECT_THAT(error.message, AllOf(HasSubstr(dir_.string()), HasSubstr("camera.max_pixels")));
  }
  EXPECT_EQ(next_frame(*camera).sequence, 4u);
}

TEST_F(FileCameraTest, NothingInAFolderEndsTheCamera) {
  write_images(1);
  std::filesystem::create_directory(dir_ / "001.jpg");
  std::filesystem::create_symlink("nowhere", dir_ / "002.jpg");
  ASSERT_EQ(mkfifo((dir_ / "003.jpg").c_str(), 0600), 0);
  std::filesystem::create_symlink("/dev/zero", dir_ / "004.jpg");
  std::filesystem::create_symlink("005.jpg", dir_ / "005.jpg");
  dir_.write("006.jpg", "");
  const std::string jpeg = jpeg_file(smooth_image(30, 20));
  dir_.write("007.jpg", jpeg.substr(0, jpeg.size() / 2));
  std::filesystem::create_symlink("000.pgm", dir_ / "008.jpg");
  const auto camera = open();
  EXPECT_THAT(
      next_events(*camera, 10),
      ElementsAre("frame 0", "unsupported 1", "stream_error 2", "unsupported 3", "unsupported 4",
                  "stream_error 5", "corrupt_frame 6", "corrupt_frame 7", "frame 8", "end"));
}

TEST_F(FileCameraTest, ErrorsNameTheFileAndTheCause) {
  std::filesystem::create_directory(dir_ / "0.jpg");
  dir_.write("1.jpg", "\xff\xd8\xff\xe0");
  const auto camera = open();
  const CameraError folder = next_error(*camera);
  EXPECT_EQ(folder.message,
            "cannot read " + (dir_ / "0.jpg").string() + ": it is a folder, not a file");
  const CameraError damaged = next_error(*camera);
  EXPECT_THAT(damaged.message,
              HasSubstr("cannot decode " + (dir_ / "1.jpg").string() + ": the JPEG header"));
}

TEST_F(FileCameraTest, FilesMayVanishAndComeBackMidRun) {
  write_images(4);
  const auto camera = open({.loop = true});
  next_frame(*camera);
  std::filesystem::remove(dir_ / name(1));
  EXPECT_THAT(next_events(*camera, 2), ElementsAre("stream_error 1", "frame 2"));
  std::filesystem::remove_all(dir_.path());
  EXPECT_THAT(next_events(*camera, 3),
              ElementsAre("stream_error 3", "stream_error 4", "stream_error 5"));
  write_images(4);
  EXPECT_THAT(next_events(*camera, 1), ElementsAre("frame 6"));
}

TEST_F(FileCameraTest, ALapWithoutAnyFrameEndsTheLoopOfALockStepCamera) {
  dir_.write("0.jpg", "");
  dir_.write("1.jpg", "");
  EXPECT_THAT(next_events(*open({.loop = true}), 4),
              ElementsAre("corrupt_frame 0", "corrupt_frame 1", "end", "end"));
}

TEST_F(FileCameraTest, ThePoolBoundsWhatIsInFlight) {
  write_images(3);
  const auto camera = open();
  std::vector<Frame> held;
  held.push_back(next_frame(*camera));
  held.push_back(next_frame(*camera));
  EXPECT_EQ(pool_.available(), 0u);
  std::jthread consumer([&held] { held.erase(held.begin()); });
  EXPECT_EQ(next_frame(*camera).sequence, 2u);
  EXPECT_EQ(camera->dropped(), 0u);
}

TEST_F(FileCameraTest, TheEndNeedsNoFreeBuffer) {
  write_images(2);
  const auto camera = open();
  const Frame first = next_frame(*camera);
  const Frame second = next_frame(*camera);
  EXPECT_THAT(next_events(*camera, 1), ElementsAre("end"));
}

TEST_F(FileCameraTest, AnInterruptEndsTheWaitForABufferAndEverythingAfterIt) {
  write_images(3);
  const auto camera = open();
  const Frame first = next_frame(*camera);
  const Frame second = next_frame(*camera);
  std::jthread stopper([&camera] { camera->interrupt(); });
  EXPECT_THAT(next_events(*camera, 2), ElementsAre("interrupted", "interrupted"));
}

TEST_F(FileCameraTest, AnInterruptBeforeTheFirstFrameHolds) {
  write_images(1);
  const auto camera = open();
  camera->interrupt();
  EXPECT_THAT(next_events(*camera, 2), ElementsAre("interrupted", "interrupted"));
}

TEST_F(FileCameraTest, TimesComeFromTheirFileAndGoOnGrowingWhenLooping) {
  write_images(3, "images/");
  dir_.write("times.txt", "10.0\n10.5\n11.0\n");
  const auto camera = open({.loop = true, .nominal_fps = 7});
  std::vector<std::int64_t> times;
  for (int i = 0; i < 7; ++i) times.push_back(next_frame(*camera).time_ns.value_or(-1));
  const std::int64_t half = kSecond_ns / 2;
  EXPECT_THAT(times, ElementsAre(20 * half, 21 * half, 22 * half, 23 * half, 24 * half, 25 * half,
                                 26 * half));
}

TEST_F(FileCameraTest, TimesMayLieBesideTheImages) {
  write_images(1, "images/");
  dir_.write("images/times.txt", "1.5");
  EXPECT_EQ(next_frame(*open()).time_ns, 1'500'000'000);
}

TEST_F(FileCameraTest, BadTimesAreRefusedAtTheStart) {
  write_images(3);
  dir_.write("times.txt", "1\n2\n");
  EXPECT_THAT(open_error({}), HasSubstr("2 times for 3 images"));
  dir_.write("times.txt", "1\ntwo\n3\n");
  EXPECT_THAT(open_error({}), AllOf(HasSubstr("times.txt"), HasSubstr("line 2")));
  std::filesystem::remove(dir_ / "times.txt");
  std::filesystem::create_directory(dir_ / "times.txt");
  EXPECT_THAT(open_error({}), HasSubstr("folder"));
}

TEST_F(FileCameraTest, ANominalRateMakesTimesFromTheIndex) {
  write_images(3);
  const auto camera = open({.start = 1, .nominal_fps = 30});
  EXPECT_EQ(next_frame(*camera).time_ns, 33'333'333);
  EXPECT_EQ(next_frame(*camera).time_ns, 66'666'667);
}

TEST_F(FileCameraTest, WhatCannotBeOpenedIsSaidAtTheStart) {
  EXPECT_THAT(open_error({}), AllOf(HasSubstr("no image"), HasSubstr(dir_.string())));
  EXPECT_THAT(open_error({.path = (dir_ / "missing").string()}), HasSubstr("No such file"));
  ASSERT_EQ(mkfifo((dir_ / "pipe").c_str(), 0600), 0);
  EXPECT_THAT(open_error({.path = (dir_ / "pipe").string()}), HasSubstr("neither"));
  std::filesystem::create_directory(dir_ / "images");
  EXPECT_THAT(open_error({}), HasSubstr("images"));
}

TEST_F(FileCameraTest, OptionsOutOfRangeAreAllListed) {
  write_images(1);
  const std::string message = open_error({.fps = -1, .start = -5, .nominal_fps = 1e9});
  EXPECT_THAT(message, AllOf(HasSubstr("; nominal_fps must"), HasSubstr(": fps must"),
                             HasSubstr("start must")));
  EXPECT_THAT(open_error({.faults = "freeze@1 stall@2"}), HasSubstr("2 mistakes"));
}

TEST_F(FileCameraTest, DroppedFramesAreAGapInTheNumbers) {
  write_images(6);
  const auto camera = open({.faults = "drop@1:3"});
  EXPECT_THAT(next_events(*camera, 4), ElementsAre("frame 0", "frame 4", "frame 5", "end"));
  EXPECT_EQ(camera->dropped(), 3u);
}

TEST_F(FileCameraTest, DropsToBeyondTheEndAreTheEnd) {
  write_images(3);
  EXPECT_THAT(next_events(*open({.faults = "drop@1:1000000"}), 2), ElementsAre("frame 0", "end"));
}

TEST_F(FileCameraTest, CorruptedFilesFailInTheRealDecoders) {
  dir_.write("0.pgm", pgm_file(smooth_image(30, 20)));
  dir_.write("1.png", png_file(smooth_image(30, 20, 3)));
  dir_.write("2.jpg", jpeg_file(smooth_image(30, 20)));
  const auto camera = open({.loop = true, .faults = "corrupt@0:3"});
  for (const char* words : {"PGM/PPM data ends early", "PNG data is damaged", "the JPEG "}) {
    const CameraError error = next_error(*camera);
    EXPECT_EQ(error.fault, CameraFault::kCorruptFrame);
    EXPECT_FALSE(error.lost);
    EXPECT_THAT(error.message, HasSubstr(words));
  }
}

TEST_F(FileCameraTest, CorruptedFramesAreFineInTheNextLap) {
  write_images(2);
  EXPECT_THAT(next_events(*open({.loop = true, .faults = "corrupt@1"}), 4),
              ElementsAre("frame 0", "corrupt_frame 1", "frame 2", "frame 3"));
}

TEST_F(FileCameraTest, AnUnpluggedCameraComesBackWhereItWas) {
  write_images(3);
  const auto camera = open({.nominal_fps = 10, .faults = "unplug@1:5s"});
  next_frame(*camera);
  EXPECT_THAT(next_events(*camera, 1), ElementsAre("unplugged 1 lost"));
  // 5 s at the nominal 30 frames a second.
  EXPECT_THAT(next_events(*camera, 150), Each("no_device 1 lost"));
  const Frame frame = next_frame(*camera);
  EXPECT_EQ(frame.sequence, 1u);
  EXPECT_EQ(frame.time_ns, kSecond_ns / 10 + 5 * kSecond_ns);
  EXPECT_EQ(next_frame(*camera).time_ns, kSecond_ns / 5 + 5 * kSecond_ns);
  EXPECT_EQ(camera->dropped(), 0u);
}

TEST_F(FileCameraTest, AShortStallOnlyDelays) {
  write_images(3);
  const auto camera = open({.nominal_fps = 10, .faults = "stall@1:1s"});
  EXPECT_EQ(next_frame(*camera).time_ns, 0);
  EXPECT_EQ(next_frame(*camera).time_ns, kSecond_ns / 10 + kSecond_ns);
}

TEST_F(FileCameraTest, ALongStallIsReportedOnceForEachTimeOut) {
  write_images(2);
  const auto camera = open({.faults = "stall@1:3500ms"});
  EXPECT_THAT(next_events(*camera, 6), ElementsAre("frame 0", "stalled 1 lost", "stalled 1 lost",
                                                   "stalled 1 lost", "frame 1", "end"));
}

TEST_F(FileCameraTest, ScriptedErrorsNameThePathAndTheFrame) {
  write_images(2);
  const auto camera = open({.faults = "unplug@0:1s"});
  const CameraError error = next_error(*camera);
  EXPECT_THAT(error.message, AllOf(HasSubstr(dir_.string()), HasSubstr("scripted at frame 0")));
}

TEST_F(FileCameraTest, TimesJumpForGood) {
  write_images(4);
  const auto camera = open({.nominal_fps = 1, .faults = "jump@1:+3600s jump@3:-2s"});
  std::vector<std::int64_t> times_s;
  for (int i = 0; i < 4; ++i) times_s.push_back(*next_frame(*camera).time_ns / kSecond_ns);
  EXPECT_THAT(times_s, ElementsAre(0, 3601, 3602, 3601));
}

TEST_F(FileCameraTest, SeveralFaultsAtOneFrame) {
  write_images(5);
  const auto camera = open({.faults = "drop@1:2 stall@2:2s unplug@3:100ms corrupt@3 jump@3:1s"});
  EXPECT_THAT(
      next_events(*camera, 9),
      ElementsAre("frame 0", "stalled 3 lost", "unplugged 3 lost", "no_device 3 lost",
                  "no_device 3 lost", "no_device 3 lost", "corrupt_frame 3", "frame 4", "end"));
}

TEST_F(FileCameraTest, FaultsBeforeTheStartAreForgotten) {
  write_images(3);
  EXPECT_THAT(next_events(*open({.start = 2, .faults = "unplug@1:9s drop@0:2"}), 2),
              ElementsAre("frame 2", "end"));
}

TEST_F(FileCameraTest, TwoRunsAreTheSame) {
  write_images(5);
  const FileCameraOptions options{.loop = true, .faults = "stall@3:2s drop@7:2 corrupt@11"};
  EXPECT_EQ(next_events(*open(options), 30), next_events(*open(options), 30));
}

TEST_F(FileCameraTest, DescribesItself) {
  write_images(2);
  EXPECT_EQ(open()->describe(),
            "folder of 2 images, the first 16x12, " + dir_.string() + ", as fast as possible");
  EXPECT_THAT(open({.fps = 12.5})->describe(), HasSubstr("at 12.5 fps in real time"));
}

TEST(CameraFaultName, AreStable) {
  EXPECT_EQ(camera_fault_name(CameraFault::kNoDevice), "no_device");
  EXPECT_EQ(camera_fault_name(CameraFault::kPermission), "permission");
  EXPECT_EQ(camera_fault_name(CameraFault::kUnsupported), "unsupported");
  EXPECT_EQ(camera_fault_name(CameraFault::kCorruptFrame), "corrupt_frame");
  EXPECT_EQ(camera_fault_name(CameraFault::kTooLarge), "too_large");
  EXPECT_EQ(camera_fault_name(CameraFault::kStalled), "stalled");
  EXPECT_EQ(camera_fault_name(CameraFault::kUnplugged), "unplugged");
  EXPECT_EQ(camera_fault_name(CameraFault::kStreamError), "stream_error");
}

}  // namespace
}  // namespace loopd
