#include "capture/libcamera_completions.h"

#include <gtest/gtest.h>
#include <poll.h>

#include <thread>
#include <vector>

namespace loopd {
namespace {

bool readable(const CompletionBoard& board) {
  pollfd entry{board.fd(), POLLIN, 0};
  return ::poll(&entry, 1, 0) == 1;
}

TEST(CompletionBoard, TakesWhatWasFinishedOnce) {
  CompletionBoard board;
  EXPECT_FALSE(readable(board));
  EXPECT_EQ(board.take(), 0U);
  board.finish(0);
  board.finish(31);
  EXPECT_TRUE(readable(board));
  EXPECT_EQ(board.take(), 0x80000001U);
  EXPECT_FALSE(readable(board));
  EXPECT_EQ(board.take(), 0U);
}

TEST(CompletionBoard, DisconnectWakesAndStays) {
  CompletionBoard board;
  EXPECT_FALSE(board.disconnected());
  board.disconnect();
  EXPECT_TRUE(readable(board));
  EXPECT_EQ(board.take(), 0U);
  EXPECT_TRUE(board.disconnected());
}

// Each thread owns its buffers, as libcamera does between queueing and completion: it finishes one
// again only after the taker has given it back.
TEST(CompletionBoard, NothingIsLostBetweenThreads) {
  constexpr std::size_t kThreads = 4;
  constexpr int kRounds = 2000;
  CompletionBoard board;
  std::vector<std::atomic<bool>> with_thread(kThreads);
  std::vector<int> taken(kThreads, 0);
  for (auto& flag : with_thread) flag = true;
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < kThreads; ++i)
    threads.emplace_back([&, i] {
      for (int round = 0; round < kRounds; ++round) {
        with_thread[i].wait(false, std::memory_order_acquire);
        with_thread[i].store(false, std::memory_order_relaxed);
        board.finish(i);
      }
    });
  for (std::size_t total = 0; total < kThreads * kRounds;) {
    pollfd entry{board.fd(), POLLIN, 0};
    ASSERT_EQ(::poll(&entry, 1, 60'000), 1);
    const std::uint32_t done = board.take();
    for (std::size_t i = 0; i < kThreads; ++i) {
      if ((done >> i & 1U) == 0) continue;
      ++taken[i];
      ++total;
      with_thread[i].store(true, std::memory_order_release);
      with_thread[i].notify_one();
    }
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(taken, std::vector<int>(kThreads, kRounds));
  EXPECT_EQ(board.take(), 0U);
}

}  // namespace
}  // namespace loopd
