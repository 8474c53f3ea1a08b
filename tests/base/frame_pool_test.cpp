#include "base/frame_pool.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <set>
#include <stop_token>
#include <thread>
#include <vector>

namespace loopd {
namespace {

TEST(FramePool, LendsEachBufferOnceAndTakesItBack) {
  FramePool pool(3, 100);
  std::set<const std::uint8_t*> seen;
  {
    std::vector<FrameBuffer> lent;
    for (int i = 0; i < 3; ++i) {
      lent.push_back(pool.acquire());
      ASSERT_NE(lent.back(), nullptr);
      std::memset(lent.back().get(), i, pool.bytes_each());
      seen.insert(lent.back().get());
    }
    EXPECT_EQ(seen.size(), 3u);
    EXPECT_EQ(pool.available(), 0u);
    EXPECT_EQ(pool.acquire(), nullptr);
    for (int i = 0; i < 3; ++i) EXPECT_EQ(lent[static_cast<std::size_t>(i)][99], i);
  }
  EXPECT_EQ(pool.available(), 3u);
  EXPECT_TRUE(seen.contains(pool.acquire().get()));
}

TEST(FramePool, BuffersAreAlignedWhateverTheirSize) {
  for (const std::size_t bytes : {1u, 63u, 64u, 65u, 1000u}) {
    FramePool pool(2, bytes);
    const FrameBuffer first = pool.acquire();
    const FrameBuffer second = pool.acquire();
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(first.get()) % 64, 0u);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(second.get()) % 64, 0u);
  }
}

TEST(FramePool, AFrameGivesItsBufferBack) {
  FramePool pool(1, 16);
  Frame frame;
  frame.buffer = pool.acquire();
  Frame moved = std::move(frame);
  EXPECT_EQ(pool.available(), 0u);
  moved = Frame();
  EXPECT_EQ(pool.available(), 1u);
}

TEST(FramePool, AWaiterGetsTheBufferThatAnotherThreadGivesBack) {
  FramePool pool(1, 16);
  FrameBuffer held = pool.acquire();
  std::jthread waiter([&](std::stop_token stop) {
    const FrameBuffer buffer = pool.acquire(stop);
    EXPECT_NE(buffer, nullptr);
  });
  held.reset();
  waiter.join();
  EXPECT_EQ(pool.available(), 1u);
}

TEST(FramePool, AStopEndsTheWaitBeforeAndDuringIt) {
  FramePool pool(1, 16);
  const FrameBuffer held = pool.acquire();
  std::stop_source stop;
  std::jthread waiter([&] { EXPECT_EQ(pool.acquire(stop.get_token()), nullptr); });
  stop.request_stop();
  waiter.join();
  EXPECT_EQ(pool.acquire(stop.get_token()), nullptr);
}

TEST(FramePool, ManyThreadsNeverShareABuffer) {
  FramePool pool(3, sizeof(int));
  std::vector<std::jthread> threads;
  for (int id = 1; id <= 4; ++id)
    threads.emplace_back([&pool, id] {
      for (int i = 0; i < 500; ++i) {
        const FrameBuffer buffer = pool.acquire(std::stop_token());
        std::memcpy(buffer.get(), &id, sizeof id);
        int found = 0;
        std::memcpy(&found, buffer.get(), sizeof found);
        EXPECT_EQ(found, id);
      }
    });
  threads.clear();
  EXPECT_EQ(pool.available(), 3u);
}

TEST(FramePoolDeathTest, ABufferThatOutlivesItsPoolIsABrokenInvariant) {
  EXPECT_DEATH(
      {
        FrameBuffer escaped;
        FramePool pool(1, 16);
        escaped = pool.acquire();
      },
      "outlived its pool");
}

TEST(CopyToFrame, PacksTheRowsOfAStridedImage) {
  const std::vector<std::uint8_t> pixels{1, 2, 3, 99, 4, 5, 6, 99};
  const Frame frame = copy_to_frame({pixels.data(), 3, 2, 4}, 7, 123);
  EXPECT_EQ(frame.width_px, 3);
  EXPECT_EQ(frame.height_px, 2);
  EXPECT_EQ(frame.stride_bytes, 3);
  EXPECT_EQ(frame.sequence, 7u);
  EXPECT_EQ(frame.time_ns, 123);
  const std::vector<std::uint8_t> copy(frame.buffer.get(), frame.buffer.get() + 6);
  EXPECT_EQ(copy, (std::vector<std::uint8_t>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(copy_to_frame(frame.view(), 0).time_ns, std::nullopt);
}

}  // namespace
}  // namespace loopd
