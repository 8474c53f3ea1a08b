// The bytes of a recording: where each number lies, and that nothing damaged passes for a header.

#include "capture/recording_format.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <string_view>

namespace loopd {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::span<const std::uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

std::uint64_t number_at(std::span<const std::uint8_t> bytes, std::size_t at, int length) {
  std::uint64_t value = 0;
  for (int i = length - 1; i >= 0; --i) value = value << 8 | bytes[at + static_cast<unsigned>(i)];
  return value;
}

// With the checksum that belongs to it, as somebody with bad intentions would write it.
template <std::size_t kSize>
void reseal(std::array<std::uint8_t, kSize>& header) {
  const std::uint32_t crc = recording_crc(std::span(header).first(kSize - 4));
  for (std::size_t i = 0; i < 4; ++i)
    header[kSize - 4 + i] = static_cast<std::uint8_t>(crc >> (8 * i));
}

const RecordingInfo kInfo{.camera = "front",
                          .loopd_version = "0.1.0",
                          .boot_id = "0f6b4b9c-9d6c-4a5e-8a51-6f1f2a9f6d11",
                          .started_realtime_ns = 1'700'000'000'123'456'789,
                          .started_monotonic_ns = -5};
const RecordedFrame kFrame{.number = 7,
                           .sequence = 0x0123456789ABCDEF,
                           .time_ns = -2,
                           .size = {641, 3},
                           .lost_before = 9,
                           .pixels_crc = 0xCAFEBABE};

TEST(RecordingFormatTest, ChecksumIsTheCommonCrc32) {
  EXPECT_EQ(recording_crc(bytes_of("123456789")), 0xCBF43926u);
}

TEST(RecordingFormatTest, FileHeaderIsAsDocumented) {
  const RecordingFileHeader bytes = encode_recording_info(kInfo);
  const std::string text(bytes.begin(), bytes.end());
  EXPECT_EQ(text.substr(0, 8), "LOOPDREC");
  EXPECT_EQ(number_at(bytes, 8, 4), 1u);
  EXPECT_EQ(number_at(bytes, 12, 4), 256u);
  EXPECT_EQ(number_at(bytes, 16, 8), 1'700'000'000'123'456'789u);
  EXPECT_EQ(number_at(bytes, 24, 8), static_cast<std::uint64_t>(-5));
  EXPECT_EQ(number_at(bytes, 32, 4), 1u);
  EXPECT_STREQ(text.substr(40, 40).c_str(), kInfo.boot_id.c_str());
  EXPECT_STREQ(text.substr(80, 64).c_str(), "front");
  EXPECT_STREQ(text.substr(144, 64).c_str(), "0.1.0");
  EXPECT_EQ(number_at(bytes, 252, 4), recording_crc(std::span(bytes).first(252)));
}

TEST(RecordingFormatTest, FrameHeaderIsAsDocumented) {
  const RecordingFrameHeader bytes = encode_recorded_frame(kFrame);
  EXPECT_EQ(std::string(bytes.begin(), bytes.begin() + 8), "LOOPDFRM");
  EXPECT_EQ(number_at(bytes, 8, 8), 7u);
  EXPECT_EQ(number_at(bytes, 16, 8), 0x0123456789ABCDEFu);
  EXPECT_EQ(number_at(bytes, 24, 8), static_cast<std::uint64_t>(-2));
  EXPECT_EQ(number_at(bytes, 32, 4), 641u);
  EXPECT_EQ(number_at(bytes, 36, 4), 3u);
  EXPECT_EQ(number_at(bytes, 40, 4), 1u);
  EXPECT_EQ(number_at(bytes, 44, 4), 0xCAFEBABEu);
  EXPECT_EQ(number_at(bytes, 48, 8), 9u);
  EXPECT_EQ(number_at(bytes, 60, 4), recording_crc(std::span(bytes).first(60)));
}

TEST(RecordingFormatTest, HeadersComeBackAsTheyWere) {
  const Result<RecordingInfo> info = decode_recording_info(encode_recording_info(kInfo));
  ASSERT_TRUE(info.ok()) << info.error().message;
  EXPECT_EQ(info.value().camera, kInfo.camera);
  EXPECT_EQ(info.value().loopd_version, kInfo.loopd_version);
  EXPECT_EQ(info.value().boot_id, kInfo.boot_id);
  EXPECT_EQ(info.value().started_realtime_ns, kInfo.started_realtime_ns);
  EXPECT_EQ(info.value().started_monotonic_ns, kInfo.started_monotonic_ns);

  const auto frame = decode_recorded_frame(encode_recorded_frame(kFrame));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->number, kFrame.number);
  EXPECT_EQ(frame->sequence, kFrame.sequence);
  EXPECT_EQ(frame->time_ns, kFrame.time_ns);
  EXPECT_EQ(frame->size.width_px, 641);
  EXPECT_EQ(frame->size.height_px, 3);
  EXPECT_EQ(frame->lost_before, 9u);
  EXPECT_EQ(frame->pixels_crc, 0xCAFEBABEu);
}

TEST(RecordingFormatTest, ATimeOfZeroIsATime) {
  EXPECT_EQ(decode_recorded_frame(encode_recorded_frame({.time_ns = 0, .size = {1, 1}}))->time_ns,
            0);
  EXPECT_EQ(decode_recorded_frame(encode_recorded_frame({.size = {1, 1}}))->time_ns, std::nullopt);
}

TEST(RecordingFormatTest, RecordsFillWholeBlocksOf64Bytes) {
  EXPECT_EQ(recording_record_bytes({1, 1}), 128u);
  EXPECT_EQ(recording_record_bytes({64, 1}), 128u);
  EXPECT_EQ(recording_record_bytes({65, 1}), 192u);
  EXPECT_EQ(recording_record_bytes({65535, 65535}), 4'294'836'288u + 64);
}

TEST(RecordingFormatTest, NoFlippedBitGoesUnseen) {
  for (std::size_t bit = 0; bit < 8 * kRecordingFrameHeaderBytes; ++bit) {
    RecordingFrameHeader bytes = encode_recorded_frame(kFrame);
    bytes[bit / 8] = static_cast<std::uint8_t>(bytes[bit / 8] ^ 1 << bit % 8);
    ASSERT_FALSE(decode_recorded_frame(bytes)) << "bit " << bit;
  }
  for (std::size_t bit = 0; bit < 8 * kRecordingFileHeaderBytes; ++bit) {
    RecordingFileHeader bytes = encode_recording_info(kInfo);
    bytes[bit / 8] = static_cast<std::uint8_t>(bytes[bit / 8] ^ 1 << bit % 8);
    ASSERT_FALSE(decode_recording_info(bytes).ok()) << "bit " << bit;
  }
}

TEST(RecordingFormatTest, SizesThatNoImageHasAreRefusedUnderARightChecksum) {
  for (const auto& [at, value] : {std::pair{32, 0}, {36, 0}, {34, 1}, {38, 1}, {35, 255}}) {
    RecordingFrameHeader bytes = encode_recorded_frame({.size = {10, 10}});
    bytes[static_cast<std::size_t>(at)] = static_cast<std::uint8_t>(value);
    reseal(bytes);
    EXPECT_FALSE(decode_recorded_frame(bytes)) << at;
  }
}

TEST(RecordingFormatTest, UnknownFlagsAreIgnored) {
  RecordingFrameHeader bytes = encode_recorded_frame(kFrame);
  bytes[40] = 0xFF;
  reseal(bytes);
  ASSERT_TRUE(decode_recorded_frame(bytes));
  EXPECT_EQ(decode_recorded_frame(bytes)->time_ns, -2);
}

TEST(RecordingFormatTest, OtherVersionsAndClocksAreNamed) {
  RecordingFileHeader bytes = encode_recording_info(kInfo);
  bytes[8] = 2;
  reseal(bytes);
  EXPECT_THAT(decode_recording_info(bytes).error().message,
              AllOf(HasSubstr("version 2"), HasSubstr("version 1")));
  EXPECT_EQ(decode_recording_info(bytes).error().code, ENOTSUP);
  bytes = encode_recording_info(kInfo);
  bytes[32] = 7;
  reseal(bytes);
  EXPECT_THAT(decode_recording_info(bytes).error().message, HasSubstr("clock"));
}

TEST(RecordingFormatTest, ShortAndForeignFilesAreRefused) {
  const RecordingFileHeader bytes = encode_recording_info(kInfo);
  for (std::size_t length = 0; length < bytes.size(); ++length)
    ASSERT_FALSE(decode_recording_info(std::span(bytes).first(length)).ok()) << length;
  EXPECT_FALSE(is_recording(bytes_of("LOOPDRE")));
  EXPECT_FALSE(is_recording(bytes_of("loopdrec")));
  EXPECT_TRUE(is_recording(bytes_of("LOOPDREC")));
}

TEST(RecordingFormatTest, TextsAreCutAndShownSafely) {
  const auto info = decode_recording_info(
      encode_recording_info({.camera = std::string(100, 'c'), .loopd_version = "a\n\x1b[2J\xff"}));
  ASSERT_TRUE(info.ok());
  EXPECT_EQ(info.value().camera, std::string(64, 'c'));
  EXPECT_EQ(info.value().loopd_version, "a??[2J?");
}

}  // namespace
}  // namespace loopd
