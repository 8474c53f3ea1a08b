#include "events/client_queue.h"

#include <gtest/gtest.h>

#include <array>

namespace loopd {
namespace {

RecordText text(const std::string& bytes) { return std::make_shared<const std::string>(bytes); }

std::string front(const ClientQueue& queue, std::size_t parts) {
  std::vector<iovec> views(parts);
  const std::size_t filled = queue.gather(views);
  std::string bytes;
  for (std::size_t i = 0; i < filled; ++i) {
    bytes.append(static_cast<const char*>(views[i].iov_base), views[i].iov_len);
  }
  return bytes;
}

TEST(ClientQueue, SendsInOrderAcrossPartialWrites) {
  ClientQueue queue(100);
  EXPECT_TRUE(queue.offer(text("abc"), 1));
  EXPECT_TRUE(queue.offer(text("defg"), 2));
  EXPECT_EQ(front(queue, 8), "abcdefg");
  EXPECT_EQ(front(queue, 1), "abc");
  queue.consume(2);
  EXPECT_EQ(front(queue, 8), "cdefg");
  queue.consume(2);
  EXPECT_EQ(front(queue, 8), "efg");
  EXPECT_EQ(queue.bytes(), 3u);
  queue.consume(3);
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(front(queue, 8), "");
}

TEST(ClientQueue, TellsOneGapOnceHalfIsRead) {
  ClientQueue queue(10);
  EXPECT_TRUE(queue.offer(text("1234567890"), 1));
  EXPECT_TRUE(queue.full());
  EXPECT_FALSE(queue.offer(text("x"), 5));
  EXPECT_FALSE(queue.offer(text("x"), 7));
  EXPECT_FALSE(queue.consume(4));
  EXPECT_FALSE(queue.offer(text("x"), 9)) << "nothing may overtake the gap";
  const std::optional<Gap> gap = queue.consume(1);
  ASSERT_TRUE(gap);
  EXPECT_EQ(gap->count, 3u);
  EXPECT_EQ(gap->first_seq, 5u);
  EXPECT_EQ(gap->last_seq, 9u);
  EXPECT_FALSE(queue.full());
  EXPECT_TRUE(queue.offer(text("x"), 10));
  EXPECT_FALSE(queue.consume(6)) << "a gap is told once";
}

TEST(ClientQueue, TakesOneRecordLongerThanItselfWhenEmpty) {
  ClientQueue queue(10);
  EXPECT_TRUE(queue.offer(text(std::string(50, 'x')), 1));
  EXPECT_FALSE(queue.offer(text("y"), 2));
  const std::optional<Gap> gap = queue.consume(50);
  ASSERT_TRUE(gap);
  EXPECT_EQ(gap->count, 1u);
}

TEST(ClientQueue, ALongRecordThatDoesNotFitIsAGapToo) {
  ClientQueue queue(100);
  EXPECT_TRUE(queue.offer(text("abcd"), 1));
  EXPECT_FALSE(queue.offer(text(std::string(98, 'x')), 2));
  EXPECT_TRUE(queue.full());
  const std::optional<Gap> gap = queue.consume(1);
  ASSERT_TRUE(gap);
  EXPECT_EQ(gap->first_seq, 2u);
}

TEST(ClientQueue, KnowsWhichOfItsTextsAreRecords) {
  ClientQueue queue(100);
  queue.push(text("answer"));
  EXPECT_TRUE(queue.offer(text("record"), 7));
  EXPECT_FALSE(queue.front_seq());
  queue.consume(6);
  EXPECT_EQ(queue.front_seq(), 7u);
  queue.replace_front(text("gone"));
  EXPECT_FALSE(queue.front_seq());
  EXPECT_EQ(queue.bytes(), 4u);
  EXPECT_EQ(front(queue, 8), "gone");
}

TEST(ClientQueue, AGapCanBeTakenBeforeItsTime) {
  ClientQueue queue(10);
  EXPECT_FALSE(queue.take_gap());
  EXPECT_TRUE(queue.offer(text("1234567890"), 1));
  EXPECT_FALSE(queue.has_room(1));
  EXPECT_FALSE(queue.offer(text("x"), 2));
  const std::optional<Gap> gap = queue.take_gap();
  ASSERT_TRUE(gap);
  EXPECT_EQ(gap->first_seq, 2u);
  EXPECT_FALSE(queue.take_gap());
  EXPECT_FALSE(queue.consume(10));
  EXPECT_TRUE(queue.has_room(1000)) << "an empty one takes anything";
}

}  // namespace
}  // namespace loopd
