#include "index/vocabulary.h"

#include <algorithm>
#include <cassert>
#include <deque>

#include "base/hamming.h"
#include "index/inverted_file.h"
#include "index/natural_log.h"
#include "index/word_table.h"

namespace loopd {
namespace {

// Grows `v`'s capacity by `extra` elements, at least doubling it when it grows at all.
template <class T>
void reserve_extra(std::vector<T>& v, std::size_t extra) {
  const std::size_t needed = v.size() + extra;
  if (needed > v.capacity()) v.reserve(std::max(needed, 2 * v.capacity()));
}

}  // namespace

class Vocabulary::Impl {
 public:
  explicit Impl(const IndexConfig& config) : config_(config) {}

  void search(std::span<const Descriptor> query, std::vector<Candidate>& candidates) {
    candidates.clear();
    candidates.reserve(image_ids_.size());  // nothing can fail once scores are touched
    look_up(query);
    for (const Neighbours& nearest : nearest_)
      if (matches(nearest)) score_word(nearest.first->word);
    for (const std::uint32_t image : touched_) {
      candidates.push_back({image_ids_[image], scores_[image]});
      scores_[image] = kUntouched;
    }
    touched_.clear();
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
      return a.score != b.score ? a.score > b.score : a.image < b.image;
    });
  }

  void add(ImageId image, std::span<const Descriptor> descriptors) {
    assert(image_ids_.empty() || image > image_ids_.back());
    // Everything that can fail comes first and changes nothing that can be seen.
    plan(descriptors);
    reserve_for(descriptors.size());
    std::vector<std::uint32_t> newborn(fresh_.size());
    newborns_.push_back(std::move(newborn));
    try {
      words_.reserve(fresh_.size());  // the last: it may change how words are looked up
    } catch (...) {
      newborns_.pop_back();
      throw;
    }
    commit(image, descriptors.size());
    end_probation();
  }

  std::size_t words() const { return words_.size(); }
  std::size_t images() const { return image_ids_.size(); }

  std::size_t bytes() const {
    std::size_t newborn_bytes = 0;
    for (const auto& newborn : newborns_)
      newborn_bytes += sizeof(newborn) + newborn.capacity() * sizeof(std::uint32_t);
    return sizeof(*this) + words_.bytes() + inverted_.bytes() + newborn_bytes +
           image_ids_.capacity() * sizeof(ImageId) + terms_.capacity() * sizeof(std::uint32_t) +
           scores_.capacity() * sizeof(double) + touched_.capacity() * sizeof(std::uint32_t) +
           nearest_.capacity() * sizeof(Neighbours) +
           (plan_.capacity() + made_.capacity()) * sizeof(std::uint32_t) +
           fresh_.capacity() * sizeof(Descriptor) + distances_.capacity() * sizeof(std::uint16_t);
  }

 private:
  static constexpr double kUntouched = -1;  // no score is negative

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
  void score_word(std::uint32_t word) {
    const double idf = natural_log(static_cast<double>(image_ids_.size()) /
                                   static_cast<double>(inverted_.images(word)));
    inverted_.for_each(word, [&](const Posting& posting) {
      if (scores_[posting.image] < 0) {
        scores_[posting.image] = 0;
        touched_.push_back(posting.image);  // never more than there are images: reserved by add()
      }
      const double tf = static_cast<double>(posting.count) / terms_[posting.image];
      scores_[posting.image] += tf * idf;
    });
  }

  // Decides for each descriptor which word it joins or makes; changes scratch only. The words that
  // the image itself makes count as words for the descriptors after, so that what repeats within
  // one image becomes one word, not several that would refuse each other by NNDR ever after.
  void plan(std::span<const Descriptor> descriptors) {
    look_up(descriptors);
    plan_.clear();
    fresh_.clear();
    plan_.reserve(descriptors.size());
    fresh_.reserve(descriptors.size());
    distances_.resize(descriptors.size());
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

  void reserve_for(std::size_t descriptors) {
    reserve_extra(image_ids_, 1);
    reserve_extra(terms_, 1);
    reserve_extra(scores_, 1);
    touched_.reserve(scores_.capacity());
    made_.resize(fresh_.size());
    inverted_.reserve(words_.id_limit() + fresh_.size(), descriptors);
  }

  void commit(ImageId image, std::size_t descriptors) noexcept {
    const auto slot = static_cast<std::uint32_t>(image_ids_.size());
    image_ids_.push_back(image);
    terms_.push_back(static_cast<std::uint32_t>(descriptors));
    scores_.push_back(kUntouched);
    for (std::size_t i = 0; i < fresh_.size(); ++i) made_[i] = words_.insert(fresh_[i]);
    for (const std::uint32_t planned : plan_)
      inverted_.add(planned < kFresh ? planned : made_[planned - kFresh], slot);
    std::copy(made_.begin(), made_.end(), newborns_.back().begin());
  }

  // Deletes what was new `probation_images` images ago and has been in no second image since. n_i
  // stays the number of descriptors of image i: what remains of an image does not weigh more
  // because the rest was not seen again.
  void end_probation() noexcept {
    if (config_.probation_images == 0) newborns_.clear();
    if (newborns_.size() <= static_cast<std::size_t>(config_.probation_images)) return;
    for (const std::uint32_t word : newborns_.front()) {
      if (inverted_.images(word) > 1) continue;
      inverted_.remove(word);
      words_.erase(word);
    }
    newborns_.pop_front();
  }

  static constexpr std::uint32_t kFresh = 0x80000000;  // ids of words are below

  const IndexConfig config_;
  WordTable words_;
  InvertedFile inverted_;  // images by slot: their number in the order they were added
  std::deque<std::vector<std::uint32_t>> newborns_;  // words on probation, a list an image

  // By slot.
  std::vector<ImageId> image_ids_;
  std::vector<std::uint32_t> terms_;  // n_i
  std::vector<double> scores_;        // of the search under way, kUntouched between searches

  // Scratch.
  std::vector<std::uint32_t> touched_;  // slots with a score
  std::vector<Neighbours> nearest_;
  std::vector<std::uint32_t> plan_;  // the word of each descriptor
  std::vector<Descriptor> fresh_;    // words to make
  std::vector<std::uint32_t> made_;  // their ids
  std::vector<std::uint16_t> distances_;
};

Vocabulary::Vocabulary(const IndexConfig& config) : impl_(std::make_unique<Impl>(config)) {}
Vocabulary::~Vocabulary() = default;
Vocabulary::Vocabulary(Vocabulary&&) noexcept = default;

void Vocabulary::search(std::span<const Descriptor> query, std::vector<Candidate>& candidates) {
  impl_->search(query, candidates);
}
void Vocabulary::add(ImageId image, std::span<const Descriptor> descriptors) {
  impl_->add(image, descriptors);
}
std::size_t Vocabulary::words() const { return impl_->words(); }
std::size_t Vocabulary::images() const { return impl_->images(); }
std::size_t Vocabulary::bytes() const { return impl_->bytes(); }

}  // namespace loopd
