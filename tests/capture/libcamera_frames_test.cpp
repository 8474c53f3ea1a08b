#include "capture/libcamera_frames.h"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <limits>
#include <vector>

#include "base/unique_fd.h"

namespace loopd {
namespace {

// A file of memory whose byte i is i modulo 251.
UniqueFd memory_file(std::size_t bytes) {
  UniqueFd fd(::memfd_create("frame", MFD_CLOEXEC));
  std::vector<std::uint8_t> data(bytes);
  for (std::size_t i = 0; i < bytes; ++i) data[i] = static_cast<std::uint8_t>(i % 251);
  EXPECT_EQ(::write(fd.get(), data.data(), bytes), static_cast<ssize_t>(bytes));
  return fd;
}

TEST(MappedPlane, ShowsThePlaneAtAnyOffset) {
  const UniqueFd fd = memory_file(10'000);
  const auto plane = MappedPlane::map(fd.get(), 4097, 5000);
  ASSERT_TRUE(plane.ok()) << plane.error().message;
  plane.value().begin_read();
  ASSERT_EQ(plane.value().bytes().size(), 5000U);
  EXPECT_EQ(plane.value().bytes().front(), 4097 % 251);
  EXPECT_EQ(plane.value().bytes().back(), 9096 % 251);
  plane.value().end_read();
}

TEST(MappedPlane, MovesItsMapping) {
  const UniqueFd fd = memory_file(100);
  auto plane = MappedPlane::map(fd.get(), 0, 100);
  ASSERT_TRUE(plane.ok());
  MappedPlane first = std::move(plane).value();
  MappedPlane second = std::move(first);
  EXPECT_EQ(second.bytes()[99], 99);
}

TEST(MappedPlane, APlaneBeyondItsBufferIsAnError) {
  const UniqueFd fd = memory_file(10'000);
  constexpr auto kMost = std::numeric_limits<std::size_t>::max();
  EXPECT_FALSE(MappedPlane::map(fd.get(), 0, 10'001).ok());
  EXPECT_FALSE(MappedPlane::map(fd.get(), 10'001, 1).ok());
  EXPECT_FALSE(MappedPlane::map(fd.get(), 1, kMost).ok());
  EXPECT_FALSE(MappedPlane::map(fd.get(), kMost, 1).ok());
  EXPECT_FALSE(MappedPlane::map(fd.get(), 0, 0).ok());
  EXPECT_TRUE(MappedPlane::map(fd.get(), 9'999, 1).ok());
}

TEST(MappedPlane, NoFileIsAnError) {
  const auto plane = MappedPlane::map(-1, 0, 1);
  ASSERT_FALSE(plane.ok());
  EXPECT_EQ(plane.error().code, EBADF);
}

TEST(CheckedLayout, KeepsWhatMakesSense) {
  const auto layout = checked_layout(PixelFormat::kYuyv, 640, 480, 1344);
  ASSERT_TRUE(layout);
  EXPECT_EQ(layout->width_px, 640);
  EXPECT_EQ(layout->height_px, 480);
  EXPECT_EQ(layout->stride_bytes, 1344);
}

TEST(CheckedLayout, AStrideThatIsNotGivenIsThePackedRow) {
  EXPECT_EQ(checked_layout(PixelFormat::kNv12, 640, 480, 0)->stride_bytes, 640);
  EXPECT_EQ(checked_layout(PixelFormat::kUyvy, 640, 480, 0)->stride_bytes, 1280);
  EXPECT_EQ(checked_layout(PixelFormat::kBgr24, 640, 480, 0)->stride_bytes, 1920);
  EXPECT_EQ(checked_layout(PixelFormat::kY10, 640, 480, 0)->stride_bytes, 1280);
}

TEST(CheckedLayout, JpegHasNoRows) {
  EXPECT_EQ(checked_layout(PixelFormat::kMjpeg, 640, 480, 640)->stride_bytes, 0);
}

TEST(CheckedLayout, RefusesWhatCannotBe) {
  constexpr unsigned kMost = std::numeric_limits<unsigned>::max();
  EXPECT_FALSE(checked_layout(PixelFormat::kGrey, 0, 480, 640));
  EXPECT_FALSE(checked_layout(PixelFormat::kGrey, 640, 0, 640));
  EXPECT_FALSE(checked_layout(PixelFormat::kGrey, 65536, 1, 65536));
  EXPECT_FALSE(checked_layout(PixelFormat::kGrey, 640, kMost, 640));
  EXPECT_FALSE(checked_layout(PixelFormat::kYuyv, 640, 480, 1279));
  EXPECT_FALSE(checked_layout(PixelFormat::kYuyv, 640, 480, kMost));
}

TEST(RawFrameOf, NeverReachesBeyondThePlane) {
  const std::array<std::uint8_t, 100> plane{};
  const FrameLayout layout{PixelFormat::kGrey, 10, 10, 10};
  EXPECT_EQ(raw_frame(layout, plane, 60).bytes.size(), 60U);
  EXPECT_EQ(raw_frame(layout, plane, 0).bytes.size(), 0U);
  const RawFrame most = raw_frame(layout, plane, std::numeric_limits<std::size_t>::max());
  EXPECT_EQ(most.bytes.data(), plane.data());
  EXPECT_EQ(most.bytes.size(), plane.size());
  EXPECT_EQ(most.width_px, 10);
  EXPECT_EQ(most.height_px, 10);
  EXPECT_EQ(most.stride_bytes, 10);
}

constexpr std::uint32_t kLastNumber = std::numeric_limits<std::uint32_t>::max();

TEST(Sequence, WrapsAsTheKernelsDoes) {
  EXPECT_EQ(sequence_ahead(5, 3), 2);
  EXPECT_EQ(sequence_ahead(3, 5), -2);
  EXPECT_EQ(sequence_ahead(1, kLastNumber), 2);
  EXPECT_EQ(sequence_ahead(kLastNumber, 1), -2);
}

TEST(Sequence, AFrameBehindTheLastOneIsLate) {
  EXPECT_FALSE(comes_late(0, std::nullopt, 4));
  EXPECT_FALSE(comes_late(8, 7, 4));
  EXPECT_TRUE(comes_late(6, 7, 4));
  EXPECT_TRUE(comes_late(3, 7, 4));
  EXPECT_TRUE(comes_late(kLastNumber, 1, 4));
}

TEST(Sequence, OneThatStandsStillOrBeginsAnewIsNot) {
  EXPECT_FALSE(comes_late(7, 7, 4));
  EXPECT_FALSE(comes_late(2, 7, 4));
  EXPECT_FALSE(comes_late(0, 1000, 4));
}

}  // namespace
}  // namespace loopd
