#include "index/vocabulary.h"

#include <algorithm>
#include <cassert>
#include <optional>

#include "base/fixed_array.h"
#include "base/hamming.h"
#include "index/inverted_file.h"
#include "index/natural_log.h"
#include "index/word_table.h"

namespace loopd {

class Vocabulary::Impl {
 public:
  Impl(const IndexConfig& config, const VocabularyCapacity& capacity)
      : config_(config),
        capacity_(capacity),
        words_(capacity.words),
        inverted_(capacity.words, capacity.posting_chunks),
        slots_(capacity.images) {
    assert(capacity.images <= Posting::kMaxImages);
    free_slots_.reserve(capacity.images);
    for (std::size_t slot = capacity.images; slot-- > 0;)
      free_slots_.push_back(static_cast<std::uint32_t>(slot));
    touched_.reserve(capacity.images);
    nearest_.reserve(capacity.descriptors);
    plan_.reserve(capacity.descriptors);
    fresh_.reserve(capacity.descriptors);
    made_.reserve(capacity.descriptors);
    distances_.resize(capacity.descriptors);
  }

  static std::size_t bytes_for(const VocabularyCapacity& capacity) {
    const std::size_t of_descriptor =
        sizeof(Neighbours) + 2 * sizeof(std::uint32_t) + sizeof(Descriptor) + sizeof(std::uint16_t);
    return sizeof(Impl) + WordTable::bytes_for(capacity.words) +
           InvertedFile::bytes_for(capacity.words, capacity.posting_chunks) +
           capacity.images * (sizeof(Slot) + 2 * sizeof(std::uint32_t)) +
           capacity.descriptors * of_descriptor;
  }

  void search(std::span<const Descriptor> query, std::vector<Candidate>& candidates) {
    candidates.clear();
    candidates.reserve(capacity_.images);
    look_up(query);
    for (const Neighbours& nearest : nearest_)
      if (matches(nearest)) score_word(nearest.first->word);
    for (const std::uint32_t slot : touched_) {
      candidates.push_back({slots_[slot].image, slots_[slot].score});
      slots_[slot].score = kUntouched;
    }
    touched_.clear();
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
      return a.score != b.score ? a.score > b.score : a.image < b.image;
    });
  }

  bool has_room(std::size_t descriptors) const {
    return images() < capacity_.images && inverted_.free_chunks() >= descriptors;
  }

  std::size_t add(ImageId image, std::span<const Descriptor> descriptors, std::span<WordId> words) {
    assert(images() < capacity_.images && descriptors.size() == words.size());
    assert(!newest_ || slots_[*newest_].image < image || !slots_[*newest_].used);
    plan(descriptors);
    make_words();
    const std::uint32_t slot = take_slot(image, descriptors.size());
    std::size_t shared = 0;
    for (std::size_t i = 0; i < plan_.size(); ++i) {
      words[i] = plan_[i] < kFresh ? plan_[i] : made_[plan_[i] - kFresh];
      if (words[i] == kNoWord) continue;
      shared += newest_ && inverted_.last_is(words[i], *newest_) ? 1 : 0;
    }
    for (WordId& word : words) {
      if (word == kNoWord || inverted_.add(word, slot)) continue;
      word = kNoWord;
      ++words_refused_;
    }
    newest_ = slot;
    return shared;
  }

  // n_i stays the number of descriptors of image i: what remains of an image does not weigh more
  // because the rest was not seen again.
  void end_probation(ImageId image, std::span<WordId> words) {
    const std::uint32_t slot = slot_of(image);
    for (WordId& word : words) {
      if (word == kNoWord || inverted_.images(word) > 1) continue;
      release(word, slot);  // a word twice in the image is gone the second time
      word = kNoWord;
    }
  }

  void remove(ImageId image, std::span<const WordId> words) {
    const std::uint32_t slot = slot_of(image);
    for (const WordId word : words)
      if (word != kNoWord) release(word, slot);
    slots_[slot] = {};
    free_slots_.push_back(slot);
  }

  std::size_t images_of(WordId word) const { return inverted_.images(word); }
  std::size_t count_in(WordId word, ImageId image) const {
    const std::uint32_t slot = slot_of(image);
    std::size_t count = 0;
    inverted_.for_each(word, [&](const Posting& posting) {
      if (posting.image == slot) count += posting.count;
    });
    return count;
  }

  std::size_t words() const { return words_.size(); }
  std::size_t images() const { return capacity_.images - free_slots_.size(); }
  std::uint64_t words_refused() const { return words_refused_; }
  std::size_t posting_chunks() const { return capacity_.posting_chunks - inverted_.free_chunks(); }
  std::size_t bytes_in_use() const {
    return bytes_for({images(), words(), posting_chunks(), capacity_.descriptors});
  }

 private:
  static constexpr double kUntouched = -1;  // no score is negative

  // All zero: free.
  struct Slot {
    double score;  // of the search under way, kUntouched between searches
    ImageId image;
    std::uint32_t terms : 31;  // n_i
    std::uint32_t used : 1;
  };

  // NNDR (paper, section 2.2): d1 <= ratio * d2. d1 = 0 always matches: d2 may be 0 as well, and
  // then the lower id is the word. d1 has a bound of its own, which alone decides if there is no
  // d2.
  bool matches(const Neighbours& nearest) const {
    if (!nearest.first) return false;
    const int d1 = nearest.first->distance_bits;
    if (d1 == 0) return true;
    if (d1 > config_.max_word_distance) return false;
    return !nearest.second || d1 <= config_.word_ratio * nearest.second->distance_bits;
  }

  void look_up(std::span<const Descriptor> descriptors) {
    nearest_.resize(descriptors.size());
    words_.two_nearest(descriptors, nearest_);
  }

  // Adds tf * idf of `word` to the score of every image that shows it: tf = n_wi / n_i,
  // idf = ln(N / n_w) (paper, section 2.2).
  void score_word(WordId word) {
    const double idf =
        natural_log(static_cast<double>(images()) / static_cast<double>(inverted_.images(word)));
    inverted_.for_each(word, [&](const Posting& posting) {
      Slot& slot = slots_[posting.image];
      if (slot.score < 0) {
        slot.score = 0;
        touched_.push_back(posting.image);
      }
      slot.score += static_cast<double>(posting.count) / static_cast<double>(slot.terms) * idf;
    });
  }

  // Decides for each descriptor which word it joins or makes; changes scratch only. The words that
  // the image itself makes count as words for the descriptors after, so that what repeats within
  // one image becomes one word, not several that would refuse each other by NNDR ever after.
  void plan(std::span<const Descriptor> descriptors) {
    look_up(descriptors);
    plan_.clear();
    fresh_.clear();
    for (std::size_t i = 0; i < descriptors.size(); ++i) {
      const Neighbours nearest = with_fresh(descriptors[i], nearest_[i]);
      if (matches(nearest)) {
        plan_.push_back(nearest.first->word);
      } else {
        plan_.push_back(kFresh + static_cast<std::uint32_t>(fresh_.size()));
        fresh_.push_back(descriptors[i]);
      }
    }
  }

  // The two nearest among `known` and the fresh words, which have ids from kFresh on.
  Neighbours with_fresh(const Descriptor& descriptor, Neighbours nearest) {
    const std::span<std::uint16_t> distances(distances_.data(), fresh_.size());
    hamming_distances(descriptor, fresh_, distances);
    for (std::uint32_t i = 0; i < fresh_.size(); ++i) offer(nearest, {kFresh + i, distances[i]});
    return nearest;
  }

  static void offer(Neighbours& nearest, const Neighbour& seen) {
    if (nearest.second && nearest.second->distance_bits <= seen.distance_bits) return;
    if (nearest.first && nearest.first->distance_bits <= seen.distance_bits) {
      nearest.second = seen;
    } else {
      nearest.second = nearest.first;
      nearest.first = seen;
    }
  }

  // Inserts the planned new words, as many as there is room for.
  void make_words() {
    made_.clear();
    for (const Descriptor& word : fresh_) {
      const bool room = words_.size() < capacity_.words;
      made_.push_back(room ? words_.insert(word) : kNoWord);
      words_refused_ += room ? 0 : 1;
    }
  }

  std::uint32_t take_slot(ImageId image, std::size_t terms) {
    const std::uint32_t slot = free_slots_.back();
    free_slots_.pop_back();
    slots_[slot] = {kUntouched, image, static_cast<std::uint32_t>(terms) & 0x7fffffff, 1};
    return slot;
  }

  // Precondition: `image` was added and not removed.
  std::uint32_t slot_of(ImageId image) const {
    std::uint32_t slot = 0;
    while (slot < slots_.size() && !(slots_[slot].used != 0 && slots_[slot].image == image)) ++slot;
    assert(slot < slots_.size());
    return slot;
  }

  // The image of `slot` shows `word` no longer.
  void release(WordId word, std::uint32_t slot) {
    if (inverted_.images(word) > 0 && inverted_.remove(word, slot) == 0) words_.erase(word);
  }

  static constexpr std::uint32_t kFresh = 0x80000000;  // ids of words are below

  const IndexConfig config_;
  const VocabularyCapacity capacity_;
  WordTable words_;
  InvertedFile inverted_;  // images by slot
  FixedArray<Slot> slots_;
  std::vector<std::uint32_t> free_slots_;
  std::optional<std::uint32_t> newest_;  // slot of the image added last
  std::uint64_t words_refused_ = 0;

  // Scratch.
  std::vector<std::uint32_t> touched_;  // slots with a score
  std::vector<Neighbours> nearest_;
  std::vector<std::uint32_t> plan_;  // the word of each descriptor
  std::vector<Descriptor> fresh_;    // words to make
  std::vector<WordId> made_;         // their ids
  std::vector<std::uint16_t> distances_;
};

Vocabulary::Vocabulary(const IndexConfig& config, const VocabularyCapacity& capacity)
    : impl_(std::make_unique<Impl>(config, capacity)) {}
Vocabulary::~Vocabulary() = default;
Vocabulary::Vocabulary(Vocabulary&&) noexcept = default;

std::size_t Vocabulary::bytes_for(const VocabularyCapacity& capacity) {
  return Impl::bytes_for(capacity);
}
void Vocabulary::search(std::span<const Descriptor> query, std::vector<Candidate>& candidates) {
  impl_->search(query, candidates);
}
bool Vocabulary::has_room(std::size_t descriptors) const { return impl_->has_room(descriptors); }
std::size_t Vocabulary::add(ImageId image, std::span<const Descriptor> descriptors,
                            std::span<WordId> words) {
  return impl_->add(image, descriptors, words);
}
void Vocabulary::end_probation(ImageId image, std::span<WordId> words) {
  impl_->end_probation(image, words);
}
void Vocabulary::remove(ImageId image, std::span<const WordId> words) {
  impl_->remove(image, words);
}
std::size_t Vocabulary::images_of(WordId word) const { return impl_->images_of(word); }
std::size_t Vocabulary::count_in(WordId word, ImageId image) const {
  return impl_->count_in(word, image);
}
std::size_t Vocabulary::words() const { return impl_->words(); }
std::size_t Vocabulary::images() const { return impl_->images(); }
std::uint64_t Vocabulary::words_refused() const { return impl_->words_refused(); }
std::size_t Vocabulary::posting_chunks() const { return impl_->posting_chunks(); }
std::size_t Vocabulary::bytes_in_use() const { return impl_->bytes_in_use(); }

}  // namespace loopd
