// Recordings through the file camera: the same frames again, with faults, laps and damage.

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "base/clock.h"
#include "capture/file_camera.h"
#include "capture/recording_writer.h"
#include "support/camera_events.h"
#include "support/image_files.h"
#include "support/recording_file.h"
#include "support/temp_dir.h"

namespace loopd {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::make_shot;
using testing::next_error;
using testing::next_events;
using testing::next_frame;
using testing::pgm_file;
using testing::RecordingBytes;
using testing::Shot;
using testing::smooth_image;
using testing::TempDir;

Shot shot_of(const Frame& frame) {
  const auto pixels = static_cast<std::size_t>(frame.width_px * frame.height_px);
  EXPECT_EQ(frame.stride_bytes, frame.width_px);
  return {frame.width_px, frame.height_px, frame.sequence, frame.time_ns,
          std::vector<std::uint8_t>(frame.buffer.get(), frame.buffer.get() + pixels)};
}

class RecordingPlaybackTest : public ::testing::Test {
 protected:
  Result<std::unique_ptr<Camera>> try_open(FileCameraOptions options = {}) {
    if (options.path.empty()) options.path = dir_.write("recording", recording_.bytes).string();
    return open_file_camera(options, pool_);
  }

  std::unique_ptr<Camera> open(const FileCameraOptions& options = {}) {
    auto camera = try_open(options);
    if (!camera.ok()) throw std::runtime_error(camera.error().message);
    return std::move(camera).value();
  }

  // Frames 100, 102, 104, ... a second apart from second 50 on.
  void record(int count) {
    for (int i = 0; i < count; ++i)
      recording_.add(make_shot(8 + i, 6, 100 + 2 * static_cast<std::uint64_t>(i), (50 + i) * kS));
  }

  static constexpr std::int64_t kS = 1'000'000'000;
  TempDir dir_;
  RecordingBytes recording_;
  FramePool pool_{2, 4096};
};

TEST_F(RecordingPlaybackTest, WhatACameraGaveIsPlayedBackAsItWas) {
  std::string times;
  for (int i = 0; i < 12; ++i) {
    dir_.write("images/" + std::to_string(10 + i) + ".pgm",
               pgm_file(smooth_image(20 + i, 31 - i, 1, i)));
    times += std::to_string(std::int64_t{1'000'000'007} * (i + 1)) + "\n";
  }
  dir_.write("times.txt", times);
  const std::string path = (dir_ / "recording").string();
  std::vector<Shot> live;
  {
    auto writer = RecordingWriter::start(
        UniqueFd(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600)),
        {.limits = {.keep_free_bytes = 0}});
    ASSERT_TRUE(writer.ok()) << writer.error().message;
    const auto camera = open({.path = dir_.string(), .faults = "drop@5:2 jump@9:+10s"});
    for (int i = 0; i < 10; ++i) {
      const Frame frame = next_frame(*camera);
      writer.value()->offer(frame.view(), frame.sequence, frame.time_ns);
      live.push_back(shot_of(frame));
    }
  }
  const auto camera = open({.path = path});
  for (const Shot& shot : live) EXPECT_EQ(shot_of(next_frame(*camera)), shot);
  EXPECT_THAT(next_events(*camera, 2), ElementsAre("end", "end"));
  EXPECT_EQ(live[5].sequence, 7u);
}

TEST_F(RecordingPlaybackTest, FramesKeepTheirNumbersAndTimes) {
  record(3);
  const auto camera = open();
  EXPECT_EQ(shot_of(next_frame(*camera)), make_shot(8, 6, 100, 50 * kS));
  EXPECT_EQ(shot_of(next_frame(*camera)), make_shot(9, 6, 102, 51 * kS));
  EXPECT_EQ(shot_of(next_frame(*camera)), make_shot(10, 6, 104, 52 * kS));
  EXPECT_THAT(next_events(*camera, 1), ElementsAre("end"));
  EXPECT_EQ(camera->dropped(), 0u);
}

TEST_F(RecordingPlaybackTest, SaysWhatItIs) {
  record(1);
  EXPECT_THAT(open()->describe(), AllOf(HasSubstr("recording of camera front"), HasSubstr("8x6"),
                                        HasSubstr("with times")));
}

TEST_F(RecordingPlaybackTest, LapsGoOnInNumbersAndTimes) {
  record(3);
  const auto camera = open({.loop = true});
  std::vector<Shot> shots;
  for (int i = 0; i < 8; ++i) shots.push_back(shot_of(next_frame(*camera)));
  EXPECT_EQ(shots[3].luma, shots[0].luma);
  EXPECT_EQ(shots[3].sequence, 105u);
  EXPECT_EQ(shots[3].time_ns, 53 * kS);
  EXPECT_EQ(shots[5].sequence, 109u);
  EXPECT_EQ(shots[6].sequence, 110u);
  EXPECT_EQ(shots[7].time_ns, 57 * kS);
  EXPECT_EQ(shots[7].luma, shots[1].luma);
}

TEST_F(RecordingPlaybackTest, StartsAtTheFrameToldCountedInTheFile) {
  record(3);
  EXPECT_EQ(next_frame(*open({.start = 2})).sequence, 104u);
  EXPECT_THAT(next_events(*open({.start = 3}), 1), ElementsAre("end"));
  const auto camera = open({.loop = true, .start = 4});
  EXPECT_EQ(shot_of(next_frame(*camera)).sequence, 107u);
}

TEST_F(RecordingPlaybackTest, ScriptedFaultsCountTheFramesOfTheFile) {
  record(6);
  const auto camera = open({.faults = "corrupt@1 drop@2 jump@4:+10s stall@5:1s"});
  EXPECT_THAT(next_events(*camera, 3), ElementsAre("frame 100", "corrupt_frame 102", "frame 106"));
  EXPECT_EQ(next_frame(*camera).time_ns, 64 * kS);
  EXPECT_EQ(next_frame(*camera).time_ns, 66 * kS);
  EXPECT_EQ(camera->dropped(), 1u);
  EXPECT_THAT(next_events(*open({.faults = "unplug@1:30ms"}), 4),
              ElementsAre("frame 100", "unplugged 101 lost", "frame 102", "frame 104"));
}

TEST_F(RecordingPlaybackTest, InRealTimeFramesHaveTheTimeOfTheirTurn) {
  record(3);
  const std::int64_t before_ns = monotonic_now_ns();
  const auto camera = open({.fps = 100});
  const Frame frame = next_frame(*camera);
  EXPECT_EQ(frame.sequence, 100u);
  EXPECT_GE(frame.time_ns, before_ns);
  EXPECT_LE(frame.time_ns, monotonic_now_ns());
}

TEST_F(RecordingPlaybackTest, InRealTimeAReaderFarBehindSkipsWholeLaps) {
  record(3);
  const auto camera = open({.fps = 1000, .loop = true});
  next_frame(*camera);
  const std::int64_t until_ns = monotonic_now_ns() + 20'000'000;
  while (monotonic_now_ns() < until_ns) {
  }
  const Frame frame = next_frame(*camera);
  EXPECT_GE(camera->dropped(), 15u);
  EXPECT_GE(frame.sequence, 100u + 5 * 5);
}

TEST_F(RecordingPlaybackTest, FramesWithoutTimeGetOneFromTheNominalRate) {
  recording_.add(make_shot(4, 4, 7, std::nullopt));
  recording_.add(make_shot(4, 4, 8, std::nullopt));
  EXPECT_EQ(next_frame(*open()).time_ns, std::nullopt);
  const auto camera = open({.nominal_fps = 10});
  EXPECT_EQ(next_frame(*camera).time_ns, 0);
  EXPECT_EQ(next_frame(*camera).time_ns, 100'000'000);
}

TEST_F(RecordingPlaybackTest, DamageCostsItsFrameAndNamesIt) {
  record(5);
  recording_.bytes[recording_.starts[1] + 64] ^= 1;  // a pixel
  recording_.bytes[recording_.starts[3] + 9] ^= 1;   // a header
  const auto camera = open();
  EXPECT_THAT(next_events(*camera, 1), ElementsAre("frame 100"));
  const CameraError pixels = next_error(*camera);
  EXPECT_EQ(pixels.fault, CameraFault::kCorruptFrame);
  EXPECT_EQ(pixels.sequence, 102u);
  EXPECT_FALSE(pixels.lost);
  EXPECT_THAT(pixels.message, AllOf(HasSubstr("frame 1 of"), HasSubstr("pixels are damaged")));
  EXPECT_THAT(next_events(*camera, 1), ElementsAre("frame 104"));
  EXPECT_THAT(next_error(*camera).message,
              AllOf(HasSubstr("frame 3 of"), HasSubstr("header is damaged")));
  EXPECT_THAT(next_events(*camera, 2), ElementsAre("frame 108", "end"));
}

TEST_F(RecordingPlaybackTest, ATooLargeFrameCostsItsFrameAndNamesTheRemedy) {
  recording_.add(make_shot(65, 64, 1, 1));
  recording_.add(make_shot(64, 64, 2, 2));
  const auto camera = open();
  const CameraError error = next_error(*camera);
  EXPECT_EQ(error.fault, CameraFault::kTooLarge);
  EXPECT_THAT(error.message, AllOf(HasSubstr("65x64"), HasSubstr("camera.max_pixels")));
  EXPECT_THAT(next_events(*camera, 2), ElementsAre("frame 2", "end"));
}

TEST_F(RecordingPlaybackTest, ALapWithoutAGoodFrameIsTheLast) {
  record(2);
  for (const std::size_t start : recording_.starts) recording_.bytes[start + 64] ^= 1;
  EXPECT_THAT(next_events(*open({.loop = true}), 3),
              ElementsAre("corrupt_frame 100", "corrupt_frame 102", "end"));
}

TEST_F(RecordingPlaybackTest, ARecordingWithoutFramesEndsAtOnce) {
  EXPECT_THAT(next_events(*open({.loop = true}), 2), ElementsAre("end", "end"));
  EXPECT_THAT(open()->describe(), HasSubstr("without a frame so far"));
}

TEST_F(RecordingPlaybackTest, ARecordingThatCannotBeReadIsNamed) {
  recording_.bytes[8] = 9;
  EXPECT_THAT(try_open().error().message, AllOf(HasSubstr("recording"), HasSubstr("version 9")));
  recording_.bytes.resize(20);
  EXPECT_THAT(try_open().error().message, HasSubstr("ends within its header"));
}

TEST_F(RecordingPlaybackTest, TimesOfAnySizeNeverOverflow) {
  constexpr std::int64_t kMax = std::numeric_limits<std::int64_t>::max();
  recording_.add(make_shot(2, 2, 0, -kMax));
  recording_.add(make_shot(2, 2, ~std::uint64_t{0}, kMax));
  const auto camera = open({.loop = true, .faults = "jump@5:+3600s"});
  for (int i = 0; i < 10; ++i) EXPECT_NE(next_frame(*camera).time_ns, std::nullopt);
}

}  // namespace
}  // namespace loopd
