#include "events/line_buffer.h"

#include <gtest/gtest.h>

#include <vector>

namespace loopd {
namespace {

/// All that comes out: lines, and "<long>" for one that was too long.
std::vector<std::string> drain(LineBuffer& buffer) {
  std::vector<std::string> out;
  std::string line;
  for (auto next = buffer.next(line); next != LineBuffer::Next::kNone; next = buffer.next(line)) {
    out.push_back(next == LineBuffer::Next::kLine ? line : "<long>");
  }
  return out;
}

using Lines = std::vector<std::string>;

TEST(LineBuffer, CutsAtNewlines) {
  LineBuffer buffer(10);
  buffer.append("one\ntwo\n\nthr");
  EXPECT_EQ(drain(buffer), (Lines{"one", "two", ""}));
  EXPECT_TRUE(buffer.has_partial_line());
  buffer.append("ee\n");
  EXPECT_EQ(drain(buffer), (Lines{"three"}));
  EXPECT_FALSE(buffer.has_partial_line());
}

TEST(LineBuffer, TheLimitItselfFits) {
  LineBuffer buffer(4);
  buffer.append("1234\n12345\n1\n");
  EXPECT_EQ(drain(buffer), (Lines{"1234", "<long>", "1"}));
}

TEST(LineBuffer, GivesTheSameLinesHoweverTheBytesArrive) {
  const std::string bytes = "a\n\nbcd\ntoolong\nefgh\nmuchtoolongindeed\nx\n";
  const Lines expected{"a", "", "bcd", "<long>", "efgh", "<long>", "x"};
  for (std::size_t chunk = 1; chunk <= bytes.size(); ++chunk) {
    LineBuffer buffer(4);
    Lines out;
    for (std::size_t i = 0; i < bytes.size(); i += chunk) {
      buffer.append(std::string_view(bytes).substr(i, chunk));
      for (std::string& line : drain(buffer)) out.push_back(std::move(line));
    }
    EXPECT_EQ(out, expected) << "chunks of " << chunk;
  }
}

TEST(LineBuffer, HoldsNothingOfALineWithoutEnd) {
  LineBuffer buffer(100);
  const std::string chunk(1000, 'x');
  Lines out;
  for (int i = 0; i < 10'000; ++i) {
    buffer.append(chunk);
    for (std::string& line : drain(buffer)) out.push_back(std::move(line));
    ASSERT_LE(buffer.held_bytes(), 100u);
  }
  EXPECT_EQ(out, (Lines{"<long>"}));
  EXPECT_EQ(buffer.discarded_bytes(), 10'000'000u);
  buffer.append("tail\nnext\n");
  EXPECT_EQ(drain(buffer), (Lines{"next"}));
  EXPECT_EQ(buffer.discarded_bytes(), 0u);
}

}  // namespace
}  // namespace loopd
