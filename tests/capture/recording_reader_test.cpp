// Reading recordings: whole, cut at any byte, damaged at any byte, hostile, still being written.

#include "capture/recording_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "support/recording_file.h"
#include "support/temp_dir.h"

namespace loopd {
namespace {

using ::testing::HasSubstr;
using testing::make_shot;
using testing::RecordingBytes;
using testing::Shot;
using testing::TempDir;

class RecordingReaderTest : public ::testing::Test {
 protected:
  RecordingReader open(const std::string& bytes, std::stop_token stop = {}) {
    path_ = dir_.write("recording", bytes).string();
    auto reader = RecordingReader::open(path_, std::move(stop));
    if (!reader.ok()) throw std::runtime_error(reader.error().message);
    return std::move(reader).value();
  }

  std::string open_error(const std::string& bytes) {
    const auto reader = RecordingReader::open(dir_.write("recording", bytes).string(), {});
    return reader.ok() ? "" : reader.error().message;
  }

  // Every frame whose pixels are good, by its number.
  static std::map<std::uint64_t, Shot> read_all(RecordingReader& reader) {
    std::map<std::uint64_t, Shot> shots;
    while (true) {
      const auto next = reader.next();
      EXPECT_TRUE(next.ok()) << next.error().message;
      if (!next.ok() || !next.value()) return shots;
      const RecordedFrame& frame = *next.value();
      Shot shot{frame.size.width_px, frame.size.height_px, frame.sequence, frame.time_ns,
                std::vector<std::uint8_t>(frame.size.pixels())};
      if (reader.read_pixels(shot.luma).ok()) shots[frame.number] = shot;
    }
  }

  std::map<std::uint64_t, Shot> read_all(const std::string& bytes) {
    RecordingReader reader = open(bytes);
    return read_all(reader);
  }

  // Four frames of different sizes, one without time.
  static std::map<std::uint64_t, Shot> four_shots() {
    return {{0, make_shot(5, 3, 10, 1000)},
            {1, make_shot(1, 1, 11, std::nullopt)},
            {2, make_shot(13, 7, 15, -4)},
            {3, make_shot(8, 8, 16, 9000)}};
  }

  static RecordingBytes recording_of(const std::map<std::uint64_t, Shot>& shots) {
    RecordingBytes recording;
    for (const auto& [number, shot] : shots) recording.add(shot);
    return recording;
  }

  TempDir dir_;
  std::string path_;
};

TEST_F(RecordingReaderTest, GivesBackWhatWasRecorded) {
  const auto shots = four_shots();
  RecordingReader reader = open(recording_of(shots).bytes);
  EXPECT_EQ(reader.info().camera, "front");
  EXPECT_EQ(read_all(reader), shots);
  reader.rewind();
  EXPECT_EQ(read_all(reader), shots);
}

TEST_F(RecordingReaderTest, ARecordingMayHoldNoFrame) {
  EXPECT_TRUE(read_all(RecordingBytes().bytes).empty());
}

TEST_F(RecordingReaderTest, CutAnywhereInTheLastFrameItHasTheOthers) {
  auto shots = four_shots();
  const RecordingBytes recording = recording_of(shots);
  const std::size_t pixels_end = recording.starts[3] + 64 + shots[3].luma.size();
  for (std::size_t length = pixels_end; length <= recording.bytes.size(); ++length)
    ASSERT_EQ(read_all(recording.bytes.substr(0, length)), shots) << length;
  shots.erase(3);
  for (std::size_t length = recording.starts[3]; length < pixels_end; ++length)
    ASSERT_EQ(read_all(recording.bytes.substr(0, length)), shots) << length;
}

TEST_F(RecordingReaderTest, CutWithinItsHeaderItIsRefused) {
  const std::string bytes = RecordingBytes().bytes;
  for (std::size_t length = 0; length < bytes.size(); ++length)
    ASSERT_NE(open_error(bytes.substr(0, length)), "") << length;
  EXPECT_THAT(open_error(bytes.substr(0, 100)), HasSubstr("ends within its header"));
}

TEST_F(RecordingReaderTest, ADamagedByteCostsAtMostItsOwnFrame) {
  const auto shots = four_shots();
  const RecordingBytes recording = recording_of(shots);
  for (std::size_t at = 256; at < recording.bytes.size(); ++at) {
    std::string bytes = recording.bytes;
    bytes[at] = static_cast<char>(bytes[at] ^ 0x5A);
    const auto found = read_all(bytes);
    ASSERT_GE(found.size(), shots.size() - 1) << at;
    for (const auto& [number, shot] : found) ASSERT_EQ(shot, shots.at(number)) << at;
  }
}

TEST_F(RecordingReaderTest, ALostStretchCostsTheFramesItTouches) {
  const auto shots = four_shots();
  const RecordingBytes recording = recording_of(shots);
  for (std::size_t from = 256; from < recording.starts[3]; from += 64) {
    std::string bytes = recording.bytes;
    std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(from),
              bytes.begin() + static_cast<std::ptrdiff_t>(recording.starts[3]), '\0');
    const auto found = read_all(bytes);
    for (std::size_t i = 0; i < 3; ++i) {
      const bool untouched = recording.starts[i + 1] <= from;
      EXPECT_EQ(found.count(i), untouched ? 1u : 0u) << from;
    }
    ASSERT_EQ(found.count(3), 1u) << from;
    for (const auto& [number, shot] : found) EXPECT_EQ(shot, shots.at(number));
  }
}

// As some file systems leave it after a power cut.
TEST_F(RecordingReaderTest, ATailOfZerosIsTheEnd) {
  const auto shots = four_shots();
  EXPECT_EQ(read_all(recording_of(shots).bytes + std::string(200'000, '\0')), shots);
}

TEST_F(RecordingReaderTest, DamageLargerThanASearchBlockIsCrossed) {
  const Shot large = make_shot(400, 400, 1, 1);
  const Shot last = make_shot(3, 3, 2, 2);
  RecordingBytes recording;
  recording.add(large);
  recording.add(last);
  recording.bytes[256] = 'x';
  const auto found = read_all(recording.bytes);
  EXPECT_EQ(found, (std::map<std::uint64_t, Shot>{{1, last}}));
}

TEST_F(RecordingReaderTest, PixelsThatLookLikeAFrameAreOnlyPixels) {
  RecordingBytes inner;
  inner.add(make_shot(8, 8, 500, 500));
  Shot shot{64, 3, 1, 1, {}};
  shot.luma.assign(inner.bytes.begin() + 256, inner.bytes.begin() + 256 + 128);
  shot.luma.resize(64 * 3);
  RecordingBytes recording;
  recording.add(shot);
  recording.add(make_shot(2, 2, 2, 2));
  const auto found = read_all(recording.bytes);
  EXPECT_EQ(found.size(), 2u);
  EXPECT_EQ(found.at(0), shot);
}

TEST_F(RecordingReaderTest, NumbersThatDoNotFitTheFileAreNotBelieved) {
  const Shot shot = make_shot(4, 4, 1, 1);
  for (const std::uint64_t number : {std::uint64_t{1}, std::uint64_t{3}, ~std::uint64_t{0}}) {
    RecordingBytes recording;
    recording.add({.number = number, .size = {4, 4}, .pixels_crc = recording_crc(shot.luma)},
                  shot.luma);
    EXPECT_TRUE(read_all(recording.bytes).empty()) << number;
  }
  for (const std::uint64_t number : {std::uint64_t{1}, std::uint64_t{2}}) {
    RecordingBytes recording;
    recording.add(shot);
    recording.bytes[recording.starts[0]] = 'x';  // room for one frame before the next header
    recording.add({.number = number, .size = {4, 4}, .pixels_crc = recording_crc(shot.luma)},
                  shot.luma);
    EXPECT_EQ(read_all(recording.bytes).size(), number == 1 ? 1u : 0u) << number;
  }
  const Shot other = make_shot(4, 4, 2, 2);
  RecordingBytes repeated;
  repeated.add(shot);
  repeated.add({.number = 0, .size = {4, 4}, .pixels_crc = recording_crc(other.luma)}, other.luma);
  EXPECT_EQ(read_all(repeated.bytes), (std::map<std::uint64_t, Shot>{{0, shot}}));
}

TEST_F(RecordingReaderTest, AFrameThatClaimsGigabytesIsTheEnd) {
  RecordingBytes recording;
  recording.add(make_shot(4, 4, 1, 1));
  recording.add({.number = 1, .size = {65535, 65535}}, std::vector<std::uint8_t>(100));
  EXPECT_EQ(read_all(recording.bytes).size(), 1u);
}

TEST_F(RecordingReaderTest, RandomBytesNeverMakeAFrame) {
  std::string bytes = RecordingBytes().bytes;
  std::uint32_t state = 1;
  for (int i = 0; i < 300'000; ++i) {
    state = state * 1664525 + 1013904223;
    bytes.push_back(static_cast<char>(state >> 24));
  }
  EXPECT_TRUE(read_all(bytes).empty());
}

TEST_F(RecordingReaderTest, AFrameStillBeingWrittenComesOnceItIsWhole) {
  const auto shots = four_shots();
  const RecordingBytes recording = recording_of(shots);
  RecordingReader reader = open(recording.bytes.substr(0, recording.starts[3]));
  EXPECT_EQ(read_all(reader).size(), 3u);
  for (const std::size_t length : {recording.starts[3] + 30, recording.starts[3] + 64 + 63}) {
    dir_.write("recording", recording.bytes.substr(0, length));
    EXPECT_TRUE(read_all(reader).empty());
  }
  dir_.write("recording", recording.bytes);
  EXPECT_EQ(read_all(reader), (std::map<std::uint64_t, Shot>{{3, shots.at(3)}}));
}

TEST_F(RecordingReaderTest, AFileCutShortWhileItIsReadIsAnError) {
  RecordingReader reader = open(recording_of(four_shots()).bytes);
  ASSERT_TRUE(reader.next().value());
  std::filesystem::resize_file(path_, 256 + 64 + 2);
  std::vector<std::uint8_t> luma(15);
  const Status status = reader.read_pixels(luma);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, EBADMSG);
  EXPECT_THAT(status.error().message, HasSubstr("cut short"));
  EXPECT_FALSE(reader.next().value());
}

TEST_F(RecordingReaderTest, ASearchCanBeStopped) {
  std::stop_source stop;
  RecordingReader reader = open(RecordingBytes().bytes, stop.get_token());
  std::filesystem::resize_file(path_, std::uintmax_t{64} << 30);  // sparse; minutes to search
  stop.request_stop();
  EXPECT_FALSE(reader.next().value());
}

TEST_F(RecordingReaderTest, WhatIsNoRecordingIsRefusedByName) {
  EXPECT_THAT(open_error("text"), HasSubstr("no recording of loopd"));
  EXPECT_THAT(RecordingReader::open(dir_.string(), {}).error().message,
              HasSubstr("not a regular file"));
  EXPECT_THAT(RecordingReader::open((dir_ / "none").string(), {}).error().message,
              HasSubstr("No such file"));
  const std::string pipe = (dir_ / "pipe").string();
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(RecordingReader::open(pipe, {}).error().message, HasSubstr("not a regular file"));
}

}  // namespace
}  // namespace loopd
