#include "capture/decode.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <string>
#include <vector>

#include "capture/luma.h"
#include "support/image_files.h"

namespace loopd {
namespace {

using ::testing::HasSubstr;
using testing::jpeg_file;
using testing::pgm_file;
using testing::png_file;
using testing::PngKind;
using testing::Samples;
using testing::smooth_image;
using namespace std::string_literals;
using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kMaxPixels = 10'000;

std::span<const std::uint8_t> bytes_of(const std::string& file) {
  return {reinterpret_cast<const std::uint8_t*>(file.data()), file.size()};
}

struct Decoded {
  ImageSize size;
  Bytes luma;
  Error error;
  bool ok = false;
};

Decoded decode(const std::string& file, std::size_t max_pixels = kMaxPixels) {
  ImageDecoder decoder(max_pixels);
  Decoded result;
  result.luma.resize(max_pixels);
  const Result<ImageSize> size = decoder.decode(bytes_of(file), result.luma);
  result.ok = size.ok();
  if (!size.ok()) {
    result.error = size.error();
    return result;
  }
  result.size = size.value();
  result.luma.resize(result.size.pixels());
  return result;
}

Bytes luma_of(const Samples& image) {
  if (image.channels == 1) return image.data;
  Bytes luma;
  for (std::size_t i = 0; i + 2 < image.data.size(); i += 3)
    luma.push_back(luma_from_rgb(image.data[i], image.data[i + 1], image.data[i + 2]));
  return luma;
}

int largest_difference(const Bytes& a, const Bytes& b) {
  if (a.size() != b.size()) return 256;
  int largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

void expect_error(const std::string& file, int code, const std::string& words) {
  const Decoded result = decode(file);
  ASSERT_FALSE(result.ok);
  EXPECT_EQ(result.error.code, code) << result.error.message;
  EXPECT_THAT(result.error.message, HasSubstr(words));
}

TEST(Luma, IsTheRoundedWeightedSum) {
  EXPECT_EQ(luma_from_rgb(0, 0, 0), 0);
  EXPECT_EQ(luma_from_rgb(255, 255, 255), 255);
  for (unsigned r = 0; r < 256; r += 15)
    for (unsigned g = 0; g < 256; g += 15)
      for (unsigned b = 0; b < 256; b += 15)
        EXPECT_NEAR(luma_from_rgb(r, g, b), 0.299 * r + 0.587 * g + 0.114 * b, 0.501);
}

TEST(Decode, GreyPgmAndPngAreExact) {
  const Samples image = smooth_image(33, 17);
  for (const std::string& file : {pgm_file(image), png_file(image), png_file(image, true)}) {
    const Decoded result = decode(file);
    ASSERT_TRUE(result.ok) << result.error.message;
    EXPECT_EQ(result.size.width_px, 33);
    EXPECT_EQ(result.size.height_px, 17);
    EXPECT_EQ(result.luma, image.data);
  }
}

TEST(Decode, ColourPpmAndPngGiveTheSameExactLuma) {
  const Samples image = smooth_image(19, 23, 3);
  for (const std::string& file : {pgm_file(image), png_file(image), png_file(image, true)}) {
    const Decoded result = decode(file);
    ASSERT_TRUE(result.ok) << result.error.message;
    EXPECT_EQ(result.luma, luma_of(image));
  }
}

TEST(Decode, JpegGivesItsLumaWithinItsLoss) {
  for (const int channels : {1, 3})
    for (const bool progressive : {false, true}) {
      const Samples image = smooth_image(40, 31, channels);
      const Decoded result = decode(jpeg_file(image, progressive));
      ASSERT_TRUE(result.ok) << result.error.message;
      EXPECT_LE(largest_difference(result.luma, luma_of(image)), 6);
    }
}

TEST(Decode, OneByOne) {
  const Samples image{1, 1, 1, {200}};
  for (const std::string& file : {pgm_file(image), png_file(image), jpeg_file(image)}) {
    const Decoded result = decode(file, 1);
    ASSERT_TRUE(result.ok) << result.error.message;
    EXPECT_NEAR(result.luma.at(0), 200, 2);
  }
}

TEST(Decode, SixteenBitsByTheHighByte) {
  const Bytes expected{0x00, 0x12, 0x80, 0xff};
  const Bytes samples{0x00, 0xff, 0x12, 0x34, 0x80, 0x00, 0xff, 0xff};
  const Decoded pgm = decode("P5 4 1 65535\n" + std::string(samples.begin(), samples.end()));
  ASSERT_TRUE(pgm.ok) << pgm.error.message;
  EXPECT_EQ(pgm.luma, expected);
  const Decoded png =
      decode(png_file(4, 1, {16, PNG_COLOR_TYPE_GRAY, false, {}, false}, {samples}));
  ASSERT_TRUE(png.ok) << png.error.message;
  EXPECT_EQ(png.luma, expected);
}

TEST(Decode, SixteenBitColour) {
  const Bytes row{0x10, 0xff, 0x80, 0x00, 0xf0, 0x01};
  const Bytes expected{luma_from_rgb(0x10, 0x80, 0xf0)};
  EXPECT_EQ(decode("P6 1 1 65535\n" + std::string(row.begin(), row.end())).luma, expected);
  EXPECT_EQ(decode(png_file(1, 1, {16, PNG_COLOR_TYPE_RGB, false, {}, false}, {row})).luma,
            expected);
}

TEST(Decode, PngWithAlphaShowsTheStoredColour) {
  const Bytes rgba{200, 100, 50, 0, 10, 20, 30, 128};
  EXPECT_EQ(decode(png_file(2, 1, {8, PNG_COLOR_TYPE_RGB_ALPHA, false, {}, false}, {rgba})).luma,
            (Bytes{luma_from_rgb(200, 100, 50), luma_from_rgb(10, 20, 30)}));
  const Bytes grey_alpha{77, 0, 88, 255};
  for (const bool interlaced : {false, true})
    EXPECT_EQ(
        decode(png_file(2, 1, {8, PNG_COLOR_TYPE_GRAY_ALPHA, interlaced, {}, false}, {grey_alpha}))
            .luma,
        (Bytes{77, 88}));
}

TEST(Decode, PngWithAPaletteOrFewBits) {
  const std::vector<png_color> palette{{10, 20, 30}, {200, 100, 50}};
  for (const bool transparent : {false, true}) {
    const PngKind kind{8, PNG_COLOR_TYPE_PALETTE, false, palette, transparent};
    EXPECT_EQ(decode(png_file(2, 1, kind, {{1, 0}})).luma,
              (Bytes{luma_from_rgb(200, 100, 50), luma_from_rgb(10, 20, 30)}));
  }
  const PngKind bits{1, PNG_COLOR_TYPE_GRAY, false, {}, false};
  EXPECT_EQ(decode(png_file(4, 1, bits, {{0b10100000}})).luma, (Bytes{255, 0, 255, 0}));
  const PngKind nibbles{4, PNG_COLOR_TYPE_GRAY, true, {}, true};
  EXPECT_EQ(decode(png_file(2, 1, nibbles, {{0x0f}})).luma, (Bytes{0, 255}));
}

TEST(Decode, PnmScalesOtherMaximumValues) {
  EXPECT_EQ(decode("P5 3 1 1\n\x00\x01\x07"s).luma, (Bytes{0, 255, 255}));
  EXPECT_EQ(decode("P5 2 1 1000\n\x01\xf4\x03\xe8"s).luma, (Bytes{128, 255}));
}

TEST(Decode, PnmCommentsAndAnyWhiteSpace) {
  EXPECT_EQ(decode("P5 # a comment\n#another\n2\t1\r\n# three\n255\nab").luma, (Bytes{'a', 'b'}));
}

TEST(Decode, EveryCutOfEveryFormatIsAnErrorOrTheWholeImage) {
  const Samples image = smooth_image(24, 16, 3);
  for (const std::string& file : {pgm_file(image), png_file(image), png_file(image, true),
                                  jpeg_file(image), jpeg_file(image, true)}) {
    const Decoded whole = decode(file);
    ASSERT_TRUE(whole.ok);
    for (std::size_t length = 0; length < file.size(); ++length) {
      const Decoded cut = decode(file.substr(0, length));
      // The end marker of a JPEG may be missing in part; no pixel may.
      if (cut.ok) {
        EXPECT_EQ(cut.luma, whole.luma) << length << " of " << file.size();
      }
      if (length < file.size() - 4) {
        EXPECT_FALSE(cut.ok) << length << " of " << file.size();
      }
    }
  }
}

TEST(Decode, NoByteValueCrashes) {
  const Samples image = smooth_image(12, 9, 3);
  for (const std::string& file : {pgm_file(image), png_file(image), jpeg_file(image)})
    for (std::size_t at = 0; at < file.size(); ++at)
      for (const char value : {'\x00', '\xff', '\x80'}) {
        std::string changed = file;
        changed[at] = value;
        const Decoded result = decode(changed);
        if (!result.ok) {
          EXPECT_FALSE(result.error.message.empty());
        }
      }
}

TEST(Decode, SaysWhatIsWrong) {
  expect_error("", EBADMSG, "empty");
  expect_error("GIF89a", ENOTSUP, "no JPEG, PNG, PGM");
  expect_error("P5", EBADMSG, "PGM/PPM header");
  expect_error("P5 2 2 255\nabc", EBADMSG, "after 3 of 4 bytes");
  expect_error("P5 0 2 255\nabc", EBADMSG, "0x2");
  expect_error("P5 2 2 70000\nabc", EBADMSG, "70000");
  expect_error("\xff\xd8\xff\xe0", EBADMSG, "JPEG header");
  expect_error("\x89PNG\r\n\x1a\n", EBADMSG, "PNG header");
}

TEST(Decode, HugeSizesAreRefusedByTheHeader) {
  expect_error("P5 60000 60000 255\n", EFBIG, "60000x60000");
  expect_error("P5 4000000000 4000000000 255\n", EBADMSG, "header");
  expect_error("P6 999999999 999999999 65535\n", EFBIG, "65535");

  std::string png = png_file(smooth_image(8, 8));
  png.replace(16, 8, "\x00\x00\xff\xff\x00\x00\xff\xff"s);
  expect_error(png, EFBIG, "65535x65535");
  png.replace(16, 8, "\x7f\xff\xff\xff\x7f\xff\xff\xff"s);
  expect_error(png, EFBIG, "2147483647");

  std::string jpeg = jpeg_file(smooth_image(8, 8));
  const std::size_t frame = jpeg.find("\xff\xc0"s);
  ASSERT_NE(frame, std::string::npos);
  jpeg.replace(frame + 5, 4, "\xff\xdc\xff\xdc"s);
  expect_error(jpeg, EFBIG, "65500x65500");
}

TEST(Decode, TheLimitIsInPixelsAndInclusive) {
  const std::string file = pgm_file(smooth_image(100, 10));
  EXPECT_TRUE(decode(file, 1000).ok);
  const Decoded refused = decode(file, 999);
  EXPECT_EQ(refused.error.code, EFBIG);
  EXPECT_THAT(refused.error.message, HasSubstr("camera.max_pixels"));
}

TEST(Decode, ALargeImageIsReadWhereAllowed) {
  const Samples image{8000, 6000, 1, Bytes(48'000'000, 77)};
  const Decoded result = decode(pgm_file(image), image.data.size());
  ASSERT_TRUE(result.ok);
  EXPECT_EQ(result.luma, image.data);
}

TEST(Decode, ExtraBytesBeforeAMarkerAreForgiven) {
  std::string file = jpeg_file(smooth_image(32, 32));
  const Decoded clean = decode(file);
  file.insert(file.size() - 2, "\x01\x02\x03\x04"s);
  const Decoded padded = decode(file);
  ASSERT_TRUE(padded.ok) << padded.error.message;
  EXPECT_EQ(padded.luma, clean.luma);
}

// After some errors TurboJPEG's own state is spoilt; the next image must not pay for that.
TEST(Decode, ADecoderGoesOnAfterEveryCut) {
  ImageDecoder decoder(kMaxPixels);
  Bytes luma(kMaxPixels);
  const auto image = smooth_image(32, 32);
  for (const std::string& good : {jpeg_file(image), jpeg_file(image, true), png_file(image)})
    for (std::size_t length = 0; length < good.size() - 4; ++length) {
      EXPECT_FALSE(decoder.decode(bytes_of(good.substr(0, length)), luma).ok());
      EXPECT_TRUE(decoder.decode(bytes_of(good), luma).ok()) << "after " << length << " bytes";
    }
}

}  // namespace
}  // namespace loopd
