#include "base/mailbox.h"

#include <gtest/gtest.h>

#include <memory>
#include <thread>
#include <vector>

namespace loopd {
namespace {

TEST(Mailbox, NewestWinsAndCountsWhatItOverwrote) {
  Mailbox<int> mailbox;
  for (int i = 1; i <= 3; ++i) EXPECT_TRUE(mailbox.put(i));
  EXPECT_EQ(mailbox.take(), 3);
  EXPECT_EQ(mailbox.overwritten(), 2u);
}

TEST(Mailbox, DestroysWhatItOverwritesAtOnce) {
  Mailbox<std::shared_ptr<int>> mailbox;
  auto first = std::make_shared<int>(1);
  const std::weak_ptr<int> watched = first;
  mailbox.put(std::move(first));
  EXPECT_FALSE(watched.expired());
  mailbox.put(std::make_shared<int>(2));
  EXPECT_TRUE(watched.expired());
}

TEST(Mailbox, DeliversAfterCloseWhatWentInBefore) {
  Mailbox<int> mailbox;
  mailbox.put(1);
  mailbox.close();
  EXPECT_FALSE(mailbox.put(2));
  EXPECT_FALSE(mailbox.put_when_empty(3));
  EXPECT_EQ(mailbox.take(), 1);
  EXPECT_EQ(mailbox.take(), std::nullopt);
}

TEST(Mailbox, LockStepLosesNothing) {
  constexpr int kCount = 2000;
  Mailbox<int> mailbox;
  std::thread giver([&mailbox] {
    for (int i = 0; i < kCount; ++i) mailbox.put_when_empty(i);
    mailbox.close();
  });
  std::vector<int> taken;
  while (const std::optional<int> value = mailbox.take()) taken.push_back(*value);
  giver.join();
  ASSERT_EQ(taken.size(), static_cast<std::size_t>(kCount));
  for (int i = 0; i < kCount; ++i) ASSERT_EQ(taken[static_cast<std::size_t>(i)], i);
  EXPECT_EQ(mailbox.overwritten(), 0u);
}

TEST(Mailbox, TakenAndOverwrittenAddUp) {
  constexpr std::uint64_t kCount = 5000;
  Mailbox<std::uint64_t> mailbox;
  std::thread giver([&mailbox] {
    for (std::uint64_t i = 1; i <= kCount; ++i) mailbox.put(i);
    mailbox.close();
  });
  std::uint64_t taken = 0;
  std::uint64_t last = 0;
  while (const auto value = mailbox.take()) {
    EXPECT_GT(*value, last);
    last = *value;
    ++taken;
  }
  giver.join();
  EXPECT_EQ(last, kCount);
  EXPECT_EQ(taken + mailbox.overwritten(), kCount);
}

TEST(Mailbox, CloseWakesWhoeverWaits) {
  Mailbox<int> empty;
  std::thread taker([&empty] { EXPECT_EQ(empty.take(), std::nullopt); });
  empty.close();
  taker.join();

  Mailbox<int> full;
  full.put(1);
  std::thread giver([&full] { EXPECT_FALSE(full.put_when_empty(2)); });
  full.close();
  giver.join();
}

}  // namespace
}  // namespace loopd
