#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "base/fixed_array.h"

namespace loopd {

/// That an image shows a word, and how often.
struct Posting {
  static constexpr std::uint32_t kMaxImages = 1U << 18U;
  static constexpr std::uint32_t kMaxCount = (1U << 14U) - 1;

  std::uint32_t image : 18 = 0;  ///< any number below kMaxImages the caller gives its images
  std::uint32_t count : 14 = 0;
  friend bool operator==(const Posting&, const Posting&) = default;
};

/// For each word, by id, the images that show it. Flat and of fixed capacity: the first postings
/// lie in the word's 32-byte record (most words have no more), the others in 64-byte chunks of one
/// pool, used again when free. Nothing is allocated after construction. Deterministic.
/// Thread: const functions concurrently, else one caller at a time.
class InvertedFile {
 public:
  /// For word ids below `words` and `chunks` chunks of postings. Throws std::bad_alloc.
  InvertedFile(std::size_t words, std::size_t chunks);

  /// Bytes of one of that capacity, reached when all of it has been used.
  static std::size_t bytes_for(std::size_t words, std::size_t chunks);
  std::size_t bytes() const { return words_.bytes() + chunks_.bytes(); }

  /// add() takes at most one, and seldom any.
  std::size_t free_chunks() const { return chunks_.size() - used_chunks_; }

  /// Image `image` shows `word` once (more). An image's calls for a word must not be interrupted by
  /// another image's. False, and nothing has changed, if that needs a chunk and none is free.
  /// Precondition: image < Posting::kMaxImages.
  bool add(std::uint32_t word, std::uint32_t image) noexcept;

  /// Image `image` shows `word` no longer; nothing happens if it did not. Returns how many images
  /// are left. Cost: one pass over the word's postings.
  std::uint32_t remove(std::uint32_t word, std::uint32_t image) noexcept;

  /// In how many images `word` was seen.
  std::uint32_t images(std::uint32_t word) const { return words_[word].images; }

  /// Whether the image whose postings were added last to `word` is `image`.
  bool last_is(std::uint32_t word, std::uint32_t image) const {
    const Word& record = words_[word];
    return record.images > 0 && last(record).image == image;
  }

  /// Calls visit(Posting) for each image that shows `word`, in an order that depends on the calls
  /// made and nothing else.
  template <class Visit>
  void for_each(std::uint32_t word, Visit&& visit) const {
    const Word& record = words_[word];
    for (std::uint32_t i = 0; i < record.images && i < kInline; ++i) visit(record.postings[i]);
    std::uint32_t used = in_head(record);
    for (std::uint32_t left = chained(record), at = record.head; left > 0; at = chunks_[at].next) {
      for (std::uint32_t i = 0; i < used; ++i) visit(chunks_[at].postings[i]);
      left -= used;
      used = kInChunk;
    }
  }

 private:
  static constexpr std::uint32_t kInline = 6;
  static constexpr std::uint32_t kInChunk = 15;

  // All zero: a word in no image.
  struct alignas(32) Word {
    std::array<Posting, kInline> postings;
    std::uint32_t images;
    std::uint32_t head;  // the newest chunk; all behind it are full
  };
  struct alignas(64) Chunk {
    std::array<Posting, kInChunk> postings;
    std::uint32_t next;
  };

  static std::uint32_t chained(const Word& record) {
    return record.images > kInline ? record.images - kInline : 0;
  }
  // How many postings of the head chunk are in use.
  static std::uint32_t in_head(const Word& record) {
    const std::uint32_t n = chained(record);
    return n == 0 ? 0 : (n - 1) % kInChunk + 1;
  }
  const Posting& last(const Word& record) const {
    return chained(record) == 0 ? record.postings[record.images - 1]
                                : chunks_[record.head].postings[in_head(record) - 1];
  }
  Posting& last(Word& record) { return const_cast<Posting&>(std::as_const(*this).last(record)); }
  Posting* find(Word& record, std::uint32_t image);
  std::uint32_t take_chunk() noexcept;
  void drop_last(Word& record) noexcept;

  FixedArray<Word> words_;
  FixedArray<Chunk> chunks_;
  std::uint32_t begun_ = 0;  // chunks ever used
  std::uint32_t free_ = 0;   // the first free one of these, linked; only if used_chunks_ < begun_
  std::size_t used_chunks_ = 0;
};

}  // namespace loopd
