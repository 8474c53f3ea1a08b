#include "capture/libcamera_formats.h"

#include <gtest/gtest.h>

#include <limits>

namespace loopd {
namespace {

constexpr auto kR8 = fourcc('R', '8', ' ', ' ');
constexpr auto kNv12 = fourcc('N', 'V', '1', '2');
constexpr auto kYuyv = fourcc('Y', 'U', 'Y', 'V');
constexpr auto kMjpg = fourcc('M', 'J', 'P', 'G');
constexpr auto kBayer = fourcc('R', 'G', 'G', 'B');

FormatOffer sized(std::uint32_t code, std::vector<FrameSize> sizes) {
  return {code, 0, std::move(sizes), {}, {}, {}};
}

FormatOffer ranged(std::uint32_t code, FrameSize smallest, FrameSize largest, FrameSize step) {
  return {code, 0, {}, smallest, largest, step};
}

TEST(LibcameraFormats, DrmNamesRgbFromTheHighByteDown) {
  EXPECT_EQ(pixel_format_from_drm(fourcc('R', 'G', '2', '4'), 0), PixelFormat::kBgr24);
  EXPECT_EQ(pixel_format_from_drm(fourcc('B', 'G', '2', '4'), 0), PixelFormat::kRgb24);
}

TEST(LibcameraFormats, PlanarFormatsWithLumaFirstAreRead) {
  EXPECT_EQ(pixel_format_from_drm(fourcc('N', 'V', '2', '1'), 0), PixelFormat::kNv12);
  EXPECT_EQ(pixel_format_from_drm(fourcc('Y', 'V', '1', '2'), 0), PixelFormat::kYu12);
  EXPECT_EQ(pixel_format_from_drm(fourcc('V', 'Y', 'U', 'Y'), 0), PixelFormat::kUyvy);
  EXPECT_EQ(pixel_format_from_drm(fourcc('R', '1', '0', ' '), 0), PixelFormat::kY10);
}

TEST(LibcameraFormats, BayerAndPackedLayoutsAreNot) {
  EXPECT_EQ(pixel_format_from_drm(kBayer, 0), std::nullopt);
  EXPECT_EQ(pixel_format_from_drm(fourcc('X', 'R', '2', '4'), 0), std::nullopt);
  EXPECT_EQ(pixel_format_from_drm(fourcc('R', '1', '0', ' '), 0x0b00000000000001), std::nullopt);
  EXPECT_EQ(pixel_format_from_drm(0, 0), std::nullopt);
}

TEST(LibcameraFormats, OfOneSizeTheCheapestWins) {
  const std::vector<FormatOffer> offers{sized(kMjpg, {{640, 480}}), sized(kYuyv, {{640, 480}}),
                                        sized(kBayer, {{640, 480}}), sized(kNv12, {{640, 480}})};
  const auto choice = choose_format(offers, std::nullopt, {640, 480});
  ASSERT_TRUE(choice);
  EXPECT_EQ(choice->offer, 3U);
  EXPECT_EQ(choice->format, PixelFormat::kNv12);
  EXPECT_EQ(choice->size, (FrameSize{640, 480}));
}

TEST(LibcameraFormats, TheRightSizeCountsMoreThanTheCost) {
  const std::vector<FormatOffer> offers{sized(kR8, {{320, 240}}),
                                        sized(kMjpg, {{320, 240}, {1280, 720}})};
  const auto choice = choose_format(offers, std::nullopt, {1280, 720});
  ASSERT_TRUE(choice);
  EXPECT_EQ(choice->format, PixelFormat::kMjpeg);
  EXPECT_EQ(choice->size, (FrameSize{1280, 720}));
}

TEST(LibcameraFormats, WithoutTheRightSizeTheNearestIsTaken) {
  const std::vector<FormatOffer> offers{sized(kYuyv, {{160, 120}, {640, 480}, {1920, 1080}})};
  const auto choice = choose_format(offers, std::nullopt, {800, 600});
  ASSERT_TRUE(choice);
  EXPECT_EQ(choice->size, (FrameSize{640, 480}));
}

TEST(LibcameraFormats, OnlyTheFormatThatIsWanted) {
  const std::vector<FormatOffer> offers{sized(kYuyv, {{640, 480}}), sized(kMjpg, {{640, 480}})};
  EXPECT_EQ(choose_format(offers, PixelFormat::kMjpeg, {640, 480})->offer, 1U);
  EXPECT_FALSE(choose_format(offers, PixelFormat::kGrey, {640, 480}));
}

TEST(LibcameraFormats, NothingThatCanBeRead) {
  EXPECT_FALSE(choose_format({}, std::nullopt, {640, 480}));
  const std::vector<FormatOffer> offers{sized(kBayer, {{640, 480}})};
  EXPECT_FALSE(choose_format(offers, std::nullopt, {640, 480}));
}

TEST(LibcameraFormats, AnOfferWithoutSizesStandsForTheWantedOne) {
  const std::vector<FormatOffer> offers{sized(kYuyv, {})};
  EXPECT_EQ(choose_format(offers, std::nullopt, {800, 600})->size, (FrameSize{800, 600}));
}

TEST(LibcameraFormats, ARangeGivesTheNearestMultiple) {
  const std::vector<FormatOffer> offers{ranged(kYuyv, {64, 64}, {1921, 1081}, {16, 8})};
  const auto size = [&](FrameSize wanted) {
    return choose_format(offers, std::nullopt, wanted)->size;
  };
  EXPECT_EQ(size({640, 480}), (FrameSize{640, 480}));
  EXPECT_EQ(size({647, 483}), (FrameSize{640, 480}));
  EXPECT_EQ(size({649, 485}), (FrameSize{656, 488}));
  EXPECT_EQ(size({1, 1}), (FrameSize{64, 64}));
  EXPECT_EQ(size({65535, 65535}), (FrameSize{1920, 1080}));
  constexpr int kMost = std::numeric_limits<int>::max();
  EXPECT_EQ(size({kMost, kMost}), (FrameSize{1920, 1080}));
}

TEST(LibcameraFormats, ARangeThatMakesNoSenseIsNone) {
  constexpr int kMost = std::numeric_limits<int>::max();
  for (const FormatOffer& offer :
       {ranged(kYuyv, {64, 64}, {32, 32}, {2, 2}), ranged(kYuyv, {0, 0}, {640, 480}, {2, 2}),
        ranged(kYuyv, {64, 64}, {640, 480}, {-2, 2}),
        ranged(kYuyv, {64, 64}, {640, 480}, {0, 0})}) {
    const auto choice = choose_format(std::vector{offer}, std::nullopt, {320, 240});
    EXPECT_EQ(choice->size, (FrameSize{320, 240}));
  }
  const std::vector<FormatOffer> huge{ranged(kYuyv, {1, 1}, {kMost, kMost}, {kMost, kMost})};
  EXPECT_EQ(choose_format(huge, std::nullopt, {kMost, kMost})->size, (FrameSize{1, 1}));
}

}  // namespace
}  // namespace loopd
