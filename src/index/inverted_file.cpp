#include "index/inverted_file.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace loopd {

InvertedFile::InvertedFile(std::size_t words, std::size_t chunks) : words_(words), chunks_(chunks) {
  static_assert(sizeof(Word) == 32 && sizeof(Chunk) == 64);
}

std::size_t InvertedFile::bytes_for(std::size_t words, std::size_t chunks) {
  return FixedArray<Word>::bytes_for(words) + FixedArray<Chunk>::bytes_for(chunks);
}

std::uint32_t InvertedFile::take_chunk() noexcept {
  assert(free_chunks() > 0);
  std::uint32_t taken = free_;
  if (used_chunks_ < begun_) {
    free_ = chunks_[taken].next;
  } else {
    taken = begun_++;
  }
  ++used_chunks_;
  return taken;
}

bool InvertedFile::add(std::uint32_t word, std::uint32_t image) noexcept {
  assert(image < Posting::kMaxImages);
  Word& record = words_[word];
  if (record.images > 0 && last(record).image == image) {
    if (last(record).count < Posting::kMaxCount) ++last(record).count;
    return true;
  }
  if (record.images >= kInline && chained(record) % kInChunk == 0) {
    if (free_chunks() == 0) return false;
    const std::uint32_t chunk = take_chunk();
    chunks_[chunk].next = record.head;
    record.head = chunk;
  }
  ++record.images;
  Posting& added = last(record);
  added.image = image & (Posting::kMaxImages - 1);
  added.count = 1;
  return true;
}

Posting* InvertedFile::find(Word& record, std::uint32_t image) {
  const auto of_image = [image](const Posting& posting) { return posting.image == image; };
  const auto inline_end = record.postings.begin() + std::min(record.images, kInline);
  const auto found = std::find_if(record.postings.begin(), inline_end, of_image);
  if (found != inline_end) return &*found;
  std::uint32_t used = in_head(record);
  for (std::uint32_t left = chained(record), at = record.head; left > 0; at = chunks_[at].next) {
    auto& postings = chunks_[at].postings;
    const auto end = postings.begin() + used;
    const auto here = std::find_if(postings.begin(), end, of_image);
    if (here != end) return &*here;
    left -= used;
    used = kInChunk;
  }
  return nullptr;
}

void InvertedFile::drop_last(Word& record) noexcept {
  const bool empties_chunk = in_head(record) == 1;
  --record.images;
  if (!empties_chunk) return;
  const std::uint32_t emptied = record.head;
  record.head = chunks_[emptied].next;
  chunks_[emptied].next = free_;
  free_ = emptied;
  --used_chunks_;
}

std::uint32_t InvertedFile::remove(std::uint32_t word, std::uint32_t image) noexcept {
  Word& record = words_[word];
  if (Posting* const posting = find(record, image)) {
    *posting = last(record);
    drop_last(record);
  }
  return record.images;
}

}  // namespace loopd
