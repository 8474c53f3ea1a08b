#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace loopd {

/// That an image shows a word, and how often.
struct Posting {
  std::uint32_t image = 0;  ///< any dense number the caller gives its images
  std::uint32_t count = 0;
  friend bool operator==(const Posting&, const Posting&) = default;
};

/// For each word, by id, the images that show it, in the order they were added. Flat: the first two
/// postings lie in the word's 32-byte record (most words have no more), the others in 64-byte
/// chunks of one pool; the chunks of a deleted word are used again. Deterministic. Thread: const
/// functions concurrently, else one caller at a time.
class InvertedFile {
 public:
  /// Makes room for word ids below `id_limit` and for `extra` more postings, so that as many calls
  /// of add() cannot fail. Throws std::bad_alloc and then changes nothing that can be read.
  void reserve(std::size_t id_limit, std::size_t extra);

  /// Image `image` shows `word` once (more). An image's calls for a word must not be interrupted by
  /// another image's. Precondition: reserve() made room.
  void add(std::uint32_t word, std::uint32_t image) noexcept;

  /// Deletes all postings of `word`. Cost: O(1).
  void remove(std::uint32_t word) noexcept;

  /// In how many images `word` was seen; 0 for an id never used.
  std::uint32_t images(std::uint32_t word) const {
    return word < words_.size() ? words_[word].images : 0;
  }

  /// Calls visit(Posting) for each image that shows `word`, in the order they were added.
  template <class Visit>
  void for_each(std::uint32_t word, Visit&& visit) const {
    if (word >= words_.size()) return;
    const Word& record = words_[word];
    std::uint32_t left = record.images;
    for (std::size_t i = 0; i < kInline && left > 0; ++i, --left) visit(record.postings[i]);
    for (std::uint32_t at = record.head; left > 0; at = chunks_[at].next)
      for (std::size_t i = 0; i < kInChunk && left > 0; ++i, --left) visit(chunks_[at].postings[i]);
  }

  /// Bytes on the heap, by capacity.
  std::size_t bytes() const {
    return words_.capacity() * sizeof(Word) + chunks_.capacity() * sizeof(Chunk);
  }

 private:
  static constexpr std::size_t kInline = 2;
  static constexpr std::size_t kInChunk = 7;
  static constexpr std::uint32_t kNone = 0xffffffff;

  struct alignas(32) Word {
    std::array<Posting, kInline> postings;
    std::uint32_t images = 0;
    std::uint32_t head = kNone;  // chunks in order; all but the tail are full
    std::uint32_t tail = kNone;
  };
  struct alignas(64) Chunk {
    std::array<Posting, kInChunk> postings;
    std::uint32_t next = kNone;
  };

  static std::size_t place_in_chunk(std::uint32_t n) { return (n - kInline) % kInChunk; }
  Posting& last(Word& record);
  std::uint32_t take_chunk() noexcept;

  std::vector<Word> words_;
  std::vector<Chunk> chunks_;
  std::uint32_t free_ = kNone;  // free chunks, linked
  std::size_t free_count_ = 0;
};

}  // namespace loopd
