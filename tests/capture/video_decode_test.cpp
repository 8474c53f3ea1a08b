// A real video through loopd-video into the file camera.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <string>

#include "capture/file_camera.h"
#include "support/camera_events.h"
#include "support/temp_dir.h"

namespace loopd {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::next_events;
using testing::next_frame;
using testing::TempDir;

constexpr int kFrames = 4;

int grey_of(int frame) { return 40 + 50 * frame; }

class VideoDecodeTest : public ::testing::Test {
 protected:
  // Frames of one grey each; false if this OpenCV cannot write Motion JPEG.
  bool write_video() {
    cv::VideoWriter writer(path_, cv::CAP_OPENCV_MJPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'),
                           25, cv::Size(64, 48));
    if (!writer.isOpened()) return false;
    for (int i = 0; i < kFrames; ++i)
      writer.write(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(grey_of(i))));
    return true;
  }

  Result<std::unique_ptr<Camera>> open(FileCameraOptions options = {}) {
    options.path = path_;
    options.video_decoder = LOOPD_VIDEO_DECODER;
    return open_file_camera(options, pool_);
  }

  TempDir dir_;
  const std::string path_ = (dir_ / "video.avi").string();
  FramePool pool_{2, 64 * 48};
};

TEST_F(VideoDecodeTest, FramesComeThroughWithTheirTimes) {
  if (!write_video()) GTEST_SKIP() << "this OpenCV cannot write Motion JPEG";
  auto camera = open();
  ASSERT_TRUE(camera.ok()) << camera.error().message;
  EXPECT_THAT((*camera)->describe(), HasSubstr("video of 64x48 at 25 fps"));
  for (int i = 0; i < kFrames; ++i) {
    const Frame frame = next_frame(**camera);
    EXPECT_EQ(frame.sequence, static_cast<std::uint64_t>(i));
    EXPECT_EQ(frame.time_ns, i * 40'000'000);
    for (const int pixel : {0, 63, 64 * 24 + 32, 64 * 48 - 1})
      EXPECT_NEAR(frame.buffer[static_cast<std::size_t>(pixel)], grey_of(i), 3);
  }
  EXPECT_THAT(next_events(**camera, 1), ElementsAre("end"));
}

TEST_F(VideoDecodeTest, LoopsByStartingOver) {
  if (!write_video()) GTEST_SKIP() << "this OpenCV cannot write Motion JPEG";
  auto camera = open({.loop = true, .start = kFrames - 1});
  ASSERT_TRUE(camera.ok()) << camera.error().message;
  EXPECT_NEAR(next_frame(**camera).buffer[0], grey_of(kFrames - 1), 3);
  EXPECT_NEAR(next_frame(**camera).buffer[0], grey_of(0), 3);
}

TEST_F(VideoDecodeTest, WhatIsNoVideoIsSaidAtTheStart) {
  for (const std::string& content : {std::string(), std::string("RIFF"), std::string(5000, 'x'),
                                     std::string("#EXTM3U\nhttp://127.0.0.1:9/x.ts\n")}) {
    dir_.write("video.avi", content);
    const auto camera = open();
    ASSERT_FALSE(camera.ok());
    EXPECT_THAT(camera.error().message, HasSubstr("cannot decode the video " + path_));
  }
}

TEST_F(VideoDecodeTest, FramesLargerThanThePoolAreRefused) {
  if (!write_video()) GTEST_SKIP() << "this OpenCV cannot write Motion JPEG";
  FramePool small(1, 100);
  const auto camera =
      open_file_camera({.path = path_, .video_decoder = LOOPD_VIDEO_DECODER}, small);
  ASSERT_FALSE(camera.ok());
  EXPECT_THAT(camera.error().message, HasSubstr("camera.max_pixels"));
}

}  // namespace
}  // namespace loopd
