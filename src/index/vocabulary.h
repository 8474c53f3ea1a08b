#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "loopd/config.h"
#include "loopd/features.h"
#include "loopd/report.h"

namespace loopd {

/// Number of a word; used again once the word is deleted.
using WordId = std::uint32_t;
constexpr WordId kNoWord = 0xffffffff;

/// What a vocabulary can hold. Its memory is fixed by this.
struct VocabularyCapacity {
  std::size_t images = 0;
  std::size_t words = 0;
  std::size_t posting_chunks = 0;  ///< of 15 postings; the first 6 of a word need none
  std::size_t descriptors = 0;     ///< of one image
};

/// An incremental vocabulary of binary words with its inverted file: one for points, one for lines
/// (DESIGN section 3, step 2, and section 4). Flat arrays only, allocated when it is made.
/// Deterministic. Thread: one caller at a time (a search uses scratch memory of its own).
///
/// An image's words are kept by the caller: add() tells them, end_probation() and remove() take
/// them back. A word is deleted when the last image that shows it is removed.
class Vocabulary {
 public:
  /// Throws std::bad_alloc.
  Vocabulary(const IndexConfig& config, const VocabularyCapacity& capacity);
  ~Vocabulary();
  Vocabulary(Vocabulary&&) noexcept;

  /// Bytes of one of that capacity, reached when all of it has been used.
  static std::size_t bytes_for(const VocabularyCapacity& capacity);

  /// Every added image that shares a word with `query`, with its score: the sum over the query's
  /// matched words of tf (n_wi / n_i) times idf (log(N / n_w)). Best first, ties by lower id.
  /// Inserts nothing. `candidates` is cleared first and keeps its capacity.
  /// Precondition: at most `capacity.descriptors` of them.
  void search(std::span<const Descriptor> query, std::vector<Candidate>& candidates);

  /// Whether add() can take an image of so many descriptors with nothing left out.
  bool has_room(std::size_t descriptors) const;

  /// Makes `image` searchable: each descriptor joins the word it matches or becomes a new word, as
  /// far as there is room; words[i] is that of descriptor i, or kNoWord. Returns how many
  /// descriptors share their word with the image added before.
  /// Precondition: images() < capacity.images, ids grow from call to call, sizes are equal.
  std::size_t add(ImageId image, std::span<const Descriptor> descriptors, std::span<WordId> words);

  /// Deletes those of an image's words that no other image shows. They become kNoWord.
  void end_probation(ImageId image, std::span<WordId> words);

  /// Takes `image`, whose words these are, out; deletes words that no image shows any more.
  void remove(ImageId image, std::span<const WordId> words);

  /// In how many images `word` is, and how often in `image`: for tests of the bookkeeping.
  std::size_t images_of(WordId word) const;
  std::size_t count_in(WordId word, ImageId image) const;

  std::size_t words() const;
  std::size_t images() const;
  /// Descriptors whose word found no room, since it was made.
  std::uint64_t words_refused() const;
  std::size_t posting_chunks() const;  ///< in use
  std::size_t bytes_in_use() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace loopd
