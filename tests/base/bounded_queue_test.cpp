#include "base/bounded_queue.h"

#include <gtest/gtest.h>

#include <memory>
#include <thread>

namespace loopd {
namespace {

TEST(BoundedQueue, KeepsTheOldAndRefusesTheNewWhenFull) {
  BoundedQueue<int> queue(2);
  EXPECT_TRUE(queue.try_push(1));
  EXPECT_TRUE(queue.try_push(2));
  EXPECT_FALSE(queue.try_push(3));
  EXPECT_EQ(queue.size(), 2u);
  EXPECT_EQ(queue.try_pop(), 1);
  EXPECT_TRUE(queue.try_push(4));  // wraps around the ring
  EXPECT_EQ(queue.try_pop(), 2);
  EXPECT_EQ(queue.try_pop(), 4);
  EXPECT_EQ(queue.try_pop(), std::nullopt);
}

TEST(BoundedQueue, HoldsNothingOfWhatWasPopped) {
  BoundedQueue<std::shared_ptr<int>> queue(2);
  queue.try_push(std::make_shared<int>(1));
  const std::weak_ptr<int> watched = *queue.try_pop();
  EXPECT_TRUE(watched.expired());
}

TEST(BoundedQueue, DeliversAfterCloseWhatWentInBefore) {
  BoundedQueue<int> queue(4);
  queue.try_push(1);
  queue.push(2);
  queue.close();
  EXPECT_FALSE(queue.try_push(3));
  EXPECT_FALSE(queue.push(3));
  EXPECT_EQ(queue.pop(), 1);
  EXPECT_EQ(queue.pop(), 2);
  EXPECT_EQ(queue.pop(), std::nullopt);
}

TEST(BoundedQueue, BlockingPushLosesNothing) {
  constexpr int kCount = 2000;
  BoundedQueue<int> queue(3);
  std::thread giver([&queue] {
    for (int i = 0; i < kCount; ++i) queue.push(i);
    queue.close();
  });
  int expected = 0;
  while (const auto value = queue.pop()) ASSERT_EQ(*value, expected++);
  giver.join();
  EXPECT_EQ(expected, kCount);
}

TEST(BoundedQueue, CloseWakesWhoeverWaits) {
  BoundedQueue<int> empty(1);
  std::thread taker([&empty] { EXPECT_EQ(empty.pop(), std::nullopt); });
  empty.close();
  taker.join();

  BoundedQueue<int> full(1);
  full.try_push(1);
  std::thread giver([&full] { EXPECT_FALSE(full.push(2)); });
  full.close();
  giver.join();
}

}  // namespace
}  // namespace loopd
