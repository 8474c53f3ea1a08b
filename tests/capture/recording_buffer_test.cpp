// The bytes between capture and disk against the obvious queue.

#include "capture/recording_buffer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <random>
#include <vector>

#include "base/clock.h"
#include "support/recording_file.h"

namespace loopd {
namespace {

using testing::make_shot;
using testing::Shot;

void put(RecordingBuffer& buffer, const Shot& shot) {
  buffer.put(shot.view(), shot.sequence, shot.time_ns);
}

Shot shot_of(const RecordingBuffer::Item& item) {
  const auto pixels = item.record.subspan(64).first(item.frame.size.pixels());
  return {item.frame.size.width_px, item.frame.size.height_px, item.frame.sequence,
          item.frame.time_ns, std::vector<std::uint8_t>(pixels.begin(), pixels.end())};
}

// As the writer does, with a header put before the pixels.
Shot take(RecordingBuffer& buffer) {
  const auto item = buffer.front(std::nullopt);
  if (!item) return {};
  std::ranges::fill(item->record.first(64), std::uint8_t{0xEE});
  const Shot shot = shot_of(*item);
  buffer.pop();
  return shot;
}

TEST(RecordingBufferTest, WhatFitsIsWhatALedgerOfBytesSays) {
  RecordingBuffer buffer(4 * 128);
  for (std::uint64_t i = 0; i < 6; ++i) put(buffer, make_shot(8, 8, i, std::nullopt));
  EXPECT_EQ(buffer.lost(), 2u);
  for (std::uint64_t i = 0; i < 4; ++i) EXPECT_EQ(take(buffer), make_shot(8, 8, i, std::nullopt));
  put(buffer, make_shot(8, 8, 6, 60));
  put(buffer, make_shot(8, 8, 7, 70));
  EXPECT_EQ(buffer.front(std::nullopt)->frame.lost_before, 2u);
  buffer.pop();
  EXPECT_EQ(buffer.front(std::nullopt)->frame.lost_before, 0u);
  EXPECT_EQ(buffer.lost(), 2u);
}

TEST(RecordingBufferTest, KeepsOrderAndPixelsWhateverSizesComeAndGo) {
  RecordingBuffer buffer(10'000);
  std::deque<Shot> expected;
  std::uint64_t lost = 0;
  std::mt19937 random(1);
  for (std::uint64_t i = 0; i < 20'000; ++i) {
    if (random() % 2 == 0) {
      const Shot shot = make_shot(static_cast<int>(random() % 60 + 1),
                                  static_cast<int>(random() % 60 + 1), i, std::nullopt);
      put(buffer, shot);
      if (buffer.lost() == lost)
        expected.push_back(shot);
      else
        EXPECT_EQ(buffer.lost(), lost + 1);
      lost = buffer.lost();
    } else if (!expected.empty()) {
      ASSERT_EQ(take(buffer), expected.front());
      expected.pop_front();
    }
  }
  EXPECT_GT(lost, 100u);
}

TEST(RecordingBufferTest, AnEmptyBufferTakesAFrameOfItsWholeSize) {
  RecordingBuffer buffer(64 + 640);
  for (std::uint64_t i = 0; i < 3; ++i) {
    put(buffer, make_shot(64, 10, i, 1));
    EXPECT_EQ(take(buffer).sequence, i);
  }
  EXPECT_EQ(buffer.lost(), 0u);
  put(buffer, make_shot(65, 10, 3, 1));
  EXPECT_EQ(buffer.lost(), 1u);
}

TEST(RecordingBufferTest, RowsArePackedAndThePaddingIsZero) {
  RecordingBuffer buffer(1000);
  const std::vector<std::uint8_t> ones(128, 1);
  put(buffer, {.width = 64, .height = 2, .luma = ones});
  take(buffer);
  const std::vector<std::uint8_t> wide{1, 2, 9, 9, 3, 4, 9, 9};
  buffer.put({wide.data(), 2, 2, 4}, 0, std::nullopt);
  const auto item = buffer.front(std::nullopt);
  ASSERT_TRUE(item);
  std::vector<std::uint8_t> expected{1, 2, 3, 4};
  expected.resize(64);
  EXPECT_EQ(std::vector<std::uint8_t>(item->record.begin() + 64, item->record.end()), expected);
}

TEST(RecordingBufferTest, SmallFramesAreLimitedInNumber) {
  RecordingBuffer buffer(128 * 2 * RecordingBuffer::kMaxFrames);
  for (std::size_t i = 0; i < RecordingBuffer::kMaxFrames + 5; ++i)
    put(buffer, make_shot(1, 1, i, 1));
  EXPECT_EQ(buffer.lost(), 5u);
}

TEST(RecordingBufferTest, WhatIsNoImageIsLost) {
  RecordingBuffer buffer(1000);
  const std::uint8_t pixel = 0;
  buffer.put({nullptr, 1, 1, 1}, 0, std::nullopt);
  buffer.put({&pixel, 0, 1, 1}, 0, std::nullopt);
  buffer.put({&pixel, 1, -1, 1}, 0, std::nullopt);
  buffer.put({&pixel, 65536, 1, 65536}, 0, std::nullopt);
  EXPECT_EQ(buffer.lost(), 4u);
}

TEST(RecordingBufferTest, ClosedItGivesWhatItHasAndTakesNothing) {
  RecordingBuffer buffer(1000);
  put(buffer, make_shot(1, 1, 1, 1));
  buffer.close();
  put(buffer, make_shot(1, 1, 2, 2));
  EXPECT_EQ(take(buffer).sequence, 1u);
  EXPECT_FALSE(buffer.front(std::nullopt));
  EXPECT_EQ(buffer.lost(), 0u);
}

TEST(RecordingBufferTest, AWaitEndsAtItsDeadline) {
  RecordingBuffer buffer(1000);
  const std::int64_t deadline_ns = monotonic_now_ns() + 2'000'000;
  EXPECT_FALSE(buffer.front(deadline_ns));
  EXPECT_GE(monotonic_now_ns(), deadline_ns);
  EXPECT_FALSE(buffer.closed());
}

TEST(RecordingBufferTest, WhatIsGivenUpCountsAsLost) {
  RecordingBuffer buffer(1000);
  put(buffer, make_shot(1, 1, 1, 1));
  put(buffer, make_shot(1, 1, 2, 1));
  buffer.close();
  buffer.lose_all();
  EXPECT_FALSE(buffer.front(std::nullopt));
  EXPECT_EQ(buffer.lost(), 2u);
}

}  // namespace
}  // namespace loopd
