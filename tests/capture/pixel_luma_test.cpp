// Raw frames to luma: every format against the obvious form, and drivers that lie about sizes.

#include "capture/pixel_luma.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "capture/luma.h"
#include "support/image_files.h"

namespace loopd {
namespace {

using ::testing::HasSubstr;
using testing::jpeg_file;
using testing::smooth_image;

constexpr std::size_t kMaxPixels = 64 * 48;

std::vector<std::uint8_t> random_bytes(std::size_t count) {
  std::mt19937 random(7);
  std::vector<std::uint8_t> bytes(count);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

int bytes_per_pixel(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGrey:
    case PixelFormat::kNv12:
    case PixelFormat::kYu12:
      return 1;
    case PixelFormat::kRgb24:
    case PixelFormat::kBgr24:
      return 3;
    default:
      return 2;
  }
}

// The obvious form: pixel x of a row, from the definition of its format.
std::uint8_t obvious_luma(PixelFormat format, const std::uint8_t* row, int x) {
  const auto word = [&] { return static_cast<unsigned>(row[2 * x] + 256 * row[2 * x + 1]); };
  switch (format) {
    case PixelFormat::kYuyv:
      return row[x / 2 * 4 + (x % 2 == 0 ? 0 : 2)];
    case PixelFormat::kUyvy:
      return row[x / 2 * 4 + (x % 2 == 0 ? 1 : 3)];
    case PixelFormat::kY10:
      return static_cast<std::uint8_t>(word() % 1024 / 4);
    case PixelFormat::kY16:
      return static_cast<std::uint8_t>(word() / 256);
    case PixelFormat::kRgb24:
      return luma_from_rgb(row[3 * x], row[3 * x + 1], row[3 * x + 2]);
    case PixelFormat::kBgr24:
      return luma_from_rgb(row[3 * x + 2], row[3 * x + 1], row[3 * x]);
    default:
      return row[x];
  }
}

class RawFormatTest : public ::testing::TestWithParam<PixelFormat> {};

TEST_P(RawFormatTest, EveryWidthStrideAndAlignmentGivesTheObviousLuma) {
  const PixelFormat format = GetParam();
  const int pixel = bytes_per_pixel(format);
  const std::vector<std::uint8_t> source = random_bytes(64 * 1024);
  LumaConverter converter(kMaxPixels);
  constexpr int kHeight = 3;
  for (int width : {1, 2, 3, 15, 16, 17, 31, 33, 63, 64, 100, 257})
    for (int padding : {0, 1, 6, 64})
      for (std::size_t offset = 0; offset<17; offset += width> 64 ? 5 : 1) {
        const int stride = width * pixel + padding;
        const auto bytes = static_cast<std::size_t>(stride * (kHeight - 1) + width * pixel);
        // Exactly the bytes needed, in memory of their own: a sanitizer sees any read beyond.
        std::vector<std::uint8_t> exact(source.begin() + 100,
                                        source.begin() + 100 + static_cast<long>(bytes + offset));
        RawFrame frame{
            .format = format, .width_px = width, .height_px = kHeight, .stride_bytes = stride};
        frame.bytes = std::span(exact).subspan(offset);
        std::vector<std::uint8_t> luma(static_cast<std::size_t>(width * kHeight) + 1, 0xa5);
        const auto problem = converter.convert(frame, std::span(luma).first(luma.size() - 1));
        ASSERT_FALSE(problem) << problem->message;
        EXPECT_EQ(luma.back(), 0xa5) << "written beyond the frame";
        for (int y = 0; y < kHeight; ++y)
          for (int x = 0; x < width; ++x)
            ASSERT_EQ(luma[static_cast<std::size_t>(y * width + x)],
                      obvious_luma(format, frame.bytes.data() + y * stride, x))
                << "width " << width << " stride " << stride << " at " << x << "," << y;
      }
}

TEST_P(RawFormatTest, OneByteTooFewIsAProblem) {
  const PixelFormat format = GetParam();
  const int stride = 20 * bytes_per_pixel(format);
  const auto bytes = random_bytes(static_cast<std::size_t>(stride * 10));
  LumaConverter converter(kMaxPixels);
  std::vector<std::uint8_t> luma(200);
  RawFrame frame{.format = format, .width_px = 20, .height_px = 10, .stride_bytes = stride};
  frame.bytes = bytes;
  EXPECT_FALSE(converter.convert(frame, luma));
  frame.bytes = frame.bytes.first(bytes.size() - 1);
  const auto problem = converter.convert(frame, luma);
  ASSERT_TRUE(problem);
  EXPECT_EQ(problem->fault, CameraFault::kCorruptFrame);
  EXPECT_EQ(problem->message, "it holds " + std::to_string(bytes.size() - 1) + " of " +
                                  std::to_string(bytes.size()) + " bytes");
}

INSTANTIATE_TEST_SUITE_P(All, RawFormatTest,
                         ::testing::Values(PixelFormat::kGrey, PixelFormat::kY10, PixelFormat::kY16,
                                           PixelFormat::kNv12, PixelFormat::kYu12,
                                           PixelFormat::kYuyv, PixelFormat::kUyvy,
                                           PixelFormat::kRgb24, PixelFormat::kBgr24),
                         [](const auto& format) {
                           const std::string name(pixel_format_name(format.param));
                           return name.substr(0, name.find(' '));
                         });

CameraFault fault_of(RawFrame frame, std::span<const std::uint8_t> bytes) {
  LumaConverter converter(kMaxPixels);
  std::vector<std::uint8_t> luma(kMaxPixels);
  frame.bytes = bytes;
  const auto problem = converter.convert(frame, luma);
  EXPECT_TRUE(problem);
  return problem ? problem->fault : CameraFault::kBusy;
}

TEST(LumaConverterTest, LiesAboutSizeAndStrideAreProblems) {
  const auto bytes = random_bytes(100'000);
  const RawFrame good{
      .format = PixelFormat::kYuyv, .width_px = 64, .height_px = 48, .stride_bytes = 128};
  constexpr int kLargest = std::numeric_limits<int>::max();
  constexpr int kLeast = std::numeric_limits<int>::min();
  for (int bad : {0, -1, kLeast, 65536, kLargest}) {
    RawFrame frame = good;
    frame.width_px = bad;
    EXPECT_EQ(fault_of(frame, bytes), CameraFault::kCorruptFrame) << "width " << bad;
    frame = good;
    frame.height_px = bad;
    EXPECT_EQ(fault_of(frame, bytes), CameraFault::kCorruptFrame) << "height " << bad;
  }
  for (int bad : {0, -1, kLeast, 1, 127, kLargest}) {
    RawFrame frame = good;
    frame.stride_bytes = bad;
    EXPECT_EQ(fault_of(frame, bytes), CameraFault::kCorruptFrame) << "stride " << bad;
  }
  EXPECT_EQ(fault_of(good, {}), CameraFault::kCorruptFrame);
}

TEST(LumaConverterTest, MorePixelsThanTheMaximumAreTooLarge) {
  const auto bytes = random_bytes(100'000);
  EXPECT_EQ(fault_of({.width_px = 65, .height_px = 48, .stride_bytes = 65}, bytes),
            CameraFault::kTooLarge);
  EXPECT_EQ(fault_of({.width_px = 65535, .height_px = 65535, .stride_bytes = 65535}, bytes),
            CameraFault::kTooLarge);
}

class MjpegTest : public ::testing::Test {
 protected:
  std::optional<LumaConverter::Problem> convert(const std::string& file) {
    RawFrame frame{.format = PixelFormat::kMjpeg, .width_px = 64, .height_px = 48};
    frame.bytes = {reinterpret_cast<const std::uint8_t*>(file.data()), file.size()};
    return converter_.convert(frame, luma_);
  }

  LumaConverter converter_{kMaxPixels};
  std::vector<std::uint8_t> luma_ = std::vector<std::uint8_t>(kMaxPixels);
};

// The file without the segments of the marker 0xff `code`.
std::string without_segments(const std::string& file, unsigned char code) {
  std::string result = file.substr(0, 2);
  std::size_t at = 2;
  while (static_cast<unsigned char>(file.at(at + 1)) != 0xda) {
    const std::size_t length = 2 + 256 * static_cast<unsigned char>(file.at(at + 2)) +
                               static_cast<unsigned char>(file.at(at + 3));
    if (static_cast<unsigned char>(file.at(at + 1)) != code) result += file.substr(at, length);
    at += length;
  }
  return result + file.substr(at);
}

TEST_F(MjpegTest, AFrameWithoutHuffmanTablesIsReadAsOneWithThem) {
  const std::string file = jpeg_file(smooth_image(64, 48, 3));
  ASSERT_FALSE(convert(file));
  const std::vector<std::uint8_t> expected = luma_;
  std::fill(luma_.begin(), luma_.end(), std::uint8_t{0});
  const std::string bare = without_segments(file, 0xc4);
  ASSERT_LT(bare.size() + 300, file.size()) << "there were tables to leave out";
  LumaConverter fresh(kMaxPixels);  // one that has never seen tables
  RawFrame frame{.format = PixelFormat::kMjpeg, .width_px = 64, .height_px = 48};
  frame.bytes = {reinterpret_cast<const std::uint8_t*>(bare.data()), bare.size()};
  const auto problem = fresh.convert(frame, luma_);
  ASSERT_FALSE(problem) << problem->message;
  EXPECT_EQ(luma_, expected);
}

TEST_F(MjpegTest, PaddingBehindTheEndIsNoDamage) {
  const std::string file = jpeg_file(smooth_image(64, 48, 3));
  EXPECT_FALSE(convert(file + std::string(4096, '\0')));
  EXPECT_FALSE(convert(file + std::string(3, '\xff')));
}

TEST_F(MjpegTest, DamageIsAProblemAndTheNextFrameIsFine) {
  const std::string file = jpeg_file(smooth_image(64, 48, 3));
  for (const std::string& bad :
       {std::string(), file.substr(0, 1), file.substr(0, file.size() / 2), file.substr(0, 20),
        std::string("\xff\xd8\xff\xd9"), std::string(5000, '\0'), file.substr(2)}) {
    const auto problem = convert(bad);
    ASSERT_TRUE(problem) << bad.size();
    EXPECT_EQ(problem->fault, CameraFault::kCorruptFrame);
    EXPECT_FALSE(convert(file));
  }
}

TEST_F(MjpegTest, AnImageOfAnotherSizeOrKindIsAProblem) {
  EXPECT_THAT(convert(jpeg_file(smooth_image(32, 48, 3)))->message, HasSubstr("32x48"));
  EXPECT_THAT(convert(jpeg_file(smooth_image(65, 48)))->message, HasSubstr("65x48"));
  EXPECT_THAT(convert(testing::pgm_file(smooth_image(64, 48)))->message, HasSubstr("no JPEG"));
}

TEST(PixelFormatTest, NamesGoBothWays) {
  for (int i = 0; i < 10; ++i) {
    const auto format = static_cast<PixelFormat>(i);
    EXPECT_EQ(pixel_format_from_name(pixel_format_name(format)), format);
  }
  EXPECT_EQ(pixel_format_from_name("Y10"), PixelFormat::kY10);
  for (const char* wrong : {"", "    ", "auto", "yuyv", "YUYV ", "YUY"})
    EXPECT_EQ(pixel_format_from_name(wrong), std::nullopt) << wrong;
}

}  // namespace
}  // namespace loopd
