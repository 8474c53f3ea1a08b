#include "events/history.h"

#include <gtest/gtest.h>

namespace loopd {
namespace {

History::Entry entry(std::uint64_t seq, std::size_t bytes) {
  return {seq, RecordClass::kLoop, std::make_shared<const std::string>(bytes, 'x')};
}

TEST(History, ForgetsTheOldestBeyondItsBytes) {
  const std::size_t each = 100 + History::kEntryBytes;
  History history(3 * each, 1000);
  EXPECT_EQ(history.oldest(), 1u);
  for (std::uint64_t seq = 1; seq <= 10; ++seq) {
    history.add(entry(seq, 100));
    EXPECT_LE(history.bytes(), 3 * each);
    EXPECT_EQ(history.oldest(), seq <= 3 ? 1 : seq - 2);
  }
  for (std::uint64_t seq = 8; seq <= 10; ++seq) EXPECT_EQ(history.at(seq).seq, seq);
}

TEST(History, ForgetsTheOldestBeyondItsNumber) {
  History history(1'000'000, 2);
  for (std::uint64_t seq = 1; seq <= 5; ++seq) history.add(entry(seq, 1));
  EXPECT_EQ(history.oldest(), 4u);
}

TEST(History, ARecordLargerThanItselfEmptiesIt) {
  History history(1000, 10);
  history.add(entry(1, 10));
  history.add(entry(2, 5000));
  EXPECT_EQ(history.oldest(), 3u);
  EXPECT_EQ(history.bytes(), 0u);
  history.add(entry(3, 10));
  EXPECT_EQ(history.at(3).seq, 3u);
}

TEST(History, WithoutRoomKeepsNothing) {
  History history(0, 0);
  for (std::uint64_t seq = 1; seq <= 3; ++seq) history.add(entry(seq, 1));
  EXPECT_EQ(history.oldest(), 4u);
}

TEST(History, GoesOnAfterItIsCleared) {
  History history(10'000, 10);
  history.add(entry(1, 10));
  history.clear();
  EXPECT_EQ(history.oldest(), 2u);
  history.add(entry(2, 10));
  EXPECT_EQ(history.oldest(), 2u);
}

}  // namespace
}  // namespace loopd
