#include "index/inverted_file.h"

#include <algorithm>
#include <cassert>

namespace loopd {

void InvertedFile::reserve(std::size_t id_limit, std::size_t extra) {
  const std::size_t new_chunks = extra - std::min(extra, free_count_);
  const std::size_t needed = chunks_.size() + new_chunks;
  if (needed > chunks_.capacity()) chunks_.reserve(std::max(needed, 2 * chunks_.capacity()));
  if (id_limit <= words_.size()) return;
  if (id_limit > words_.capacity()) words_.reserve(std::max(id_limit, 2 * words_.capacity()));
  words_.resize(id_limit);
}

Posting& InvertedFile::last(Word& record) {
  const std::uint32_t at = record.images - 1;
  return at < kInline ? record.postings[at] : chunks_[record.tail].postings[place_in_chunk(at)];
}

std::uint32_t InvertedFile::take_chunk() noexcept {
  if (free_ != kNone) {
    const std::uint32_t taken = free_;
    free_ = chunks_[taken].next;
    --free_count_;
    chunks_[taken] = Chunk{};
    return taken;
  }
  assert(chunks_.size() < chunks_.capacity());
  chunks_.emplace_back();
  return static_cast<std::uint32_t>(chunks_.size() - 1);
}

void InvertedFile::add(std::uint32_t word, std::uint32_t image) noexcept {
  assert(word < words_.size());
  Word& record = words_[word];
  if (record.images > 0 && last(record).image == image) {
    ++last(record).count;
    return;
  }
  const std::uint32_t at = record.images++;
  if (at >= kInline && place_in_chunk(at) == 0) {
    const std::uint32_t chunk = take_chunk();
    (record.head == kNone ? record.head : chunks_[record.tail].next) = chunk;
    record.tail = chunk;
  }
  last(record) = {image, 1};
}

void InvertedFile::remove(std::uint32_t word) noexcept {
  assert(word < words_.size());
  Word& record = words_[word];
  if (record.head != kNone) {
    const std::size_t chained = (record.images - kInline + kInChunk - 1) / kInChunk;
    chunks_[record.tail].next = free_;
    free_ = record.head;
    free_count_ += chained;
  }
  record = Word{};
}

}  // namespace loopd
