// Videos as far as the camera sees them: decoders are small shell scripts that say anything.

#include "capture/video_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <fstream>
#include <string>
#include <thread>

#include "base/clock.h"
#include "capture/file_camera.h"
#include "support/camera_events.h"
#include "support/temp_dir.h"

namespace loopd {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::next_error;
using testing::next_events;
using testing::next_frame;
using testing::TempDir;

constexpr const char* kThreeFrames =
    "printf 'YUV4MPEG2 W2 H2 F10:1 Ip A1:1 Cmono\\nFRAME\\nabcdFRAME\\nefghFRAME\\nijkl'";

class VideoSourceTest : public ::testing::Test {
 protected:
  Result<std::unique_ptr<Camera>> try_open(const std::string& script,
                                           FileCameraOptions options = {}) {
    options.path = dir_.write("video.avi", "RIFF").string();
    options.video_decoder = dir_.write("decoder", "#!/bin/sh\n" + script + "\n").string();
    chmod(options.video_decoder.c_str(), 0700);
    return open_file_camera(options, pool_);
  }

  std::unique_ptr<Camera> open(const std::string& script, const FileCameraOptions& options = {}) {
    auto camera = try_open(script, options);
    EXPECT_TRUE(camera.ok()) << camera.error().message;
    return camera.ok() ? std::move(camera).value() : nullptr;
  }

  std::string open_error(const std::string& script) {
    const auto camera = try_open(script);
    EXPECT_FALSE(camera.ok());
    return camera.ok() ? "" : camera.error().message;
  }

  TempDir dir_;
  FramePool pool_{2, 64};
};

TEST_F(VideoSourceTest, DeliversTheFramesWithTheTimesOfTheVideo) {
  const auto camera = open(kThreeFrames);
  const Frame first = next_frame(*camera);
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(first.buffer.get()), 4), "abcd");
  EXPECT_EQ(first.width_px, 2);
  EXPECT_EQ(first.time_ns, 0);
  const Frame second = next_frame(*camera);
  EXPECT_EQ(second.sequence, 1u);
  EXPECT_EQ(second.buffer[3], 'h');
  EXPECT_EQ(second.time_ns, 100'000'000);
}

TEST_F(VideoSourceTest, DevicesAreNotOpened) {
  for (const char* device : {"/dev/null", "/dev/zero", "/dev/tty"}) {
    const auto camera = open_file_camera({.path = device}, pool_);
    ASSERT_FALSE(camera.ok());
    EXPECT_THAT(camera.error().message, HasSubstr("it is a device, no recording"));
  }
}

TEST_F(VideoSourceTest, EndsLoopsAndStarts) {
  EXPECT_THAT(next_events(*open(kThreeFrames), 5),
              ElementsAre("frame 0", "frame 1", "frame 2", "end", "end"));
  EXPECT_THAT(next_events(*open(kThreeFrames, {.start = 2}), 2), ElementsAre("frame 2", "end"));
  const auto camera = open(kThreeFrames, {.loop = true, .start = 2});
  EXPECT_EQ(next_frame(*camera).buffer[0], 'i');
  const Frame frame = next_frame(*camera);
  EXPECT_EQ(frame.sequence, 3u);
  EXPECT_EQ(frame.buffer[0], 'a');
  EXPECT_EQ(frame.time_ns, 300'000'000);
}

TEST_F(VideoSourceTest, AnOptionalRateWinsOverThatOfTheVideo) {
  const auto camera = open(kThreeFrames, {.nominal_fps = 100});
  next_frame(*camera);
  EXPECT_EQ(next_frame(*camera).time_ns, 10'000'000);
}

TEST_F(VideoSourceTest, FaultsWorkOnVideosToo) {
  const auto camera = open(kThreeFrames, {.loop = true, .faults = "corrupt@1 drop@2:2"});
  EXPECT_THAT(next_events(*camera, 4),
              ElementsAre("frame 0", "corrupt_frame 1", "frame 4", "frame 5"));
}

TEST_F(VideoSourceTest, RealTimeDropsWhatIsLate) {
  const auto camera = open(kThreeFrames, {.fps = 500, .loop = true});
  const Frame first = next_frame(*camera);
  while (monotonic_now_ns() < *first.time_ns + 20'000'000) std::this_thread::yield();
  const Frame frame = next_frame(*camera);
  EXPECT_GE(frame.sequence, 10u);
  EXPECT_EQ(frame.buffer[0], "aei"[frame.sequence % 3]);
}

TEST_F(VideoSourceTest, ADecoderThatDiesEndsTheStreamWithItsReason) {
  const auto camera = open(std::string(kThreeFrames) + "; echo no more memory >&2; kill -SEGV $$");
  EXPECT_THAT(next_events(*camera, 3), ElementsAre("frame 0", "frame 1", "frame 2"));
  const CameraError error = next_error(*camera);
  EXPECT_EQ(error.fault, CameraFault::kStreamError);
  EXPECT_TRUE(error.lost);
  EXPECT_THAT(error.message, AllOf(HasSubstr("killed by signal 11"), HasSubstr("no more memory"),
                                   HasSubstr("after frame 3")));
  EXPECT_THAT(next_events(*camera, 1), ElementsAre("end"));
}

TEST_F(VideoSourceTest, AFailingDecoderDoesNotLoopForEver) {
  EXPECT_THAT(next_events(*open(std::string(kThreeFrames) + "; exit 1", {.loop = true}), 5),
              ElementsAre("frame 0", "frame 1", "frame 2", "stream_error 3 lost", "end"));
  const std::string no_frames = "printf 'YUV4MPEG2 W2 H2 Cmono\\n'";
  EXPECT_THAT(next_events(*open(no_frames, {.loop = true}), 1), ElementsAre("end"));
}

TEST_F(VideoSourceTest, HalfAFrameIsAnError) {
  EXPECT_THAT(next_events(*open("printf 'YUV4MPEG2 W2 H2 Cmono\\nFRAME\\nab'"), 2),
              ElementsAre("stream_error 0 lost", "end"));
  EXPECT_THAT(next_events(*open("printf 'YUV4MPEG2 W2 H2 Cmono\\nGARBAGE'"), 2),
              ElementsAre("stream_error 0 lost", "end"));
}

TEST_F(VideoSourceTest, AnInterruptEndsTheWaitForASilentDecoderAndKillsIt) {
  const auto camera = open("printf 'YUV4MPEG2 W2 H2 Cmono\\n'; exec sleep 1000");
  std::jthread stopper([&camera] { camera->interrupt(); });
  const std::int64_t start_ns = monotonic_now_ns();
  EXPECT_THAT(next_events(*camera, 1), ElementsAre("interrupted"));
  EXPECT_LT(monotonic_now_ns() - start_ns, 15'000'000'000);
}

TEST_F(VideoSourceTest, TheDestructorEndsADecoderThatIsStillWriting) {
  auto camera = open(
      "echo $$ > \"$(dirname \"$1\")/pid\"\n"
      "printf 'YUV4MPEG2 W2 H2 Cmono\\n'\n"
      "while :; do printf 'FRAME\\nabcd'; done");
  next_frame(*camera);
  int pid = 0;
  std::ifstream(dir_ / "pid") >> pid;
  ASSERT_GT(pid, 0);
  ASSERT_EQ(kill(pid, 0), 0);
  camera.reset();
  EXPECT_NE(kill(pid, 0), 0);
}

TEST_F(VideoSourceTest, BadDecodersAreSaidAtTheStart) {
  EXPECT_THAT(open_error("exit 0"), HasSubstr("ended with status 0"));
  EXPECT_THAT(open_error("echo no known video format >&2; exit 1"),
              HasSubstr("no known video format"));
  EXPECT_THAT(open_error("echo hello"), HasSubstr("no valid YUV4MPEG2"));
  EXPECT_THAT(open_error("cat /dev/zero"), HasSubstr("no valid YUV4MPEG2"));
  EXPECT_THAT(open_error("printf 'YUV4MPEG2 W9 H9 Cmono\\n'"), HasSubstr("camera.max_pixels"));
}

TEST_F(VideoSourceTest, AMissingDecoderIsNamed) {
  const std::string path = dir_.write("video.avi", "RIFF").string();
  const auto camera =
      open_file_camera({.path = path, .video_decoder = (dir_ / "nothing").string()}, pool_);
  ASSERT_FALSE(camera.ok());
  EXPECT_THAT(camera.error().message, AllOf(HasSubstr("nothing is not there"), HasSubstr(path)));
}

TEST_F(VideoSourceTest, DescribesItself) {
  EXPECT_EQ(open(kThreeFrames)->describe(),
            "video of 2x2 at 10 fps, " + (dir_ / "video.avi").string() + ", as fast as possible");
}

TEST(Y4mHeader, ReadsWhatItNeedsAndRefusesTheRest) {
  const auto header = parse_y4m_header("YUV4MPEG2 W640 H480 F30000:1001 Ip A1:1 Cmono");
  ASSERT_TRUE(header.ok());
  EXPECT_EQ(header.value().size.width_px, 640);
  EXPECT_NEAR(header.value().fps, 29.97, 0.001);
  EXPECT_EQ(parse_y4m_header("YUV4MPEG2 W1 H1 F0:0 Cmono").value().fps, 0);
  for (const char* bad :
       {"", "YUV4MPEG2", "YUV4MPEG2 ", "YUV4MPEG2 W1 H1", "YUV4MPEG2 W1 H1 C420",
        "YUV4MPEG2 W0 H1 Cmono", "YUV4MPEG2 W-1 H1 Cmono", "YUV4MPEG2 W99999 H99999 Cmono",
        "YUV4MPEG2 W1 Cmono", "YUV4MPEG2 W99999999999999999999 H1 Cmono"})
    EXPECT_FALSE(parse_y4m_header(bad).ok()) << bad;
}

TEST(VideoDecoderCandidates, TheChosenOneOrTheUsualPlaces) {
  EXPECT_THAT(video_decoder_candidates("/x/y"), ElementsAre("/x/y"));
  EXPECT_EQ(video_decoder_candidates("").back(), "loopd-video");
  EXPECT_EQ(video_decoder_candidates("").size(), 3u);
}

}  // namespace
}  // namespace loopd
