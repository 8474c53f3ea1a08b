#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/huge_pages.h"
#include "index/best_words.h"
#include "index/neighbours.h"
#include "index/word_buckets.h"
#include "index/word_links.h"
#include "loopd/features.h"

namespace loopd {

/// Binary words in one flat array, addressed by 32-bit ids (freed ids are reused, the last freed
/// first), with an approximate look-up of the two nearest (DESIGN section 4).
///
/// Up to kLearnAt words the look-up is a linear scan and exact. From there on it measures the words
/// that share a bucket with the query in any of the hash tables (WordBuckets), then, kRounds times,
/// those that the nearest few found so far link to (WordLinks). The tables find what is alone, the
/// links what lies in a crowd and what no table has in common with the query.
///
/// Every call's cost is bounded, whatever the words. The longest is the insertion that makes
/// kLearnAt words: it chooses the key bits and fills the tables, 2-5 ms.
///
/// Deterministic: results depend on the calls made and on nothing else.
/// Thread: one caller at a time (look-ups use scratch memory).
class WordTable {
 public:
  /// A table that grows by reserve().
  WordTable();
  /// A table that holds `capacity` words without ever allocating again. Its memory is taken now but
  /// touched only as words come. Throws std::bad_alloc.
  explicit WordTable(std::size_t capacity);
  /// bytes() of WordTable(capacity) at most, and exactly until it learns its key bits.
  static std::size_t bytes_for(std::size_t capacity);

  /// Makes room for `extra` more words, so that as many insertions cannot fail; within the capacity
  /// given at construction it does nothing. Throws std::bad_alloc and then changes no result.
  void reserve(std::size_t extra);

  /// Adds a word and returns its id. Equal words may be added. Cost: about a third of a look-up's
  /// if the word was a query of the latest look-up of several (of its first kRemembered, and they
  /// come in the same order), else the look-up more.
  /// Precondition: reserve() made room for it.
  std::uint32_t insert(const Descriptor& word) noexcept;

  /// Removes word `id`. Cost: O(tables + links). Precondition: `id` is of a word.
  void erase(std::uint32_t id) noexcept;

  /// The two nearest words found, by (distance, id); fewer than two if fewer were found.
  Neighbours two_nearest(const Descriptor& query);

  /// nearest[i] = two_nearest(queries[i]), faster. Sizes are equal.
  void two_nearest(std::span<const Descriptor> queries, std::span<Neighbours> nearest);

  /// Precondition: `id` is of a word.
  const Descriptor& descriptor(std::uint32_t id) const;
  /// Precondition: id < id_limit().
  bool live(std::uint32_t id) const { return ((live_[id / 64] >> (id % 64)) & 1U) != 0; }

  std::size_t size() const { return size_; }
  /// Every id is below it.
  std::size_t id_limit() const { return words_.size(); }
  /// Bytes on the heap, by capacity.
  std::size_t bytes() const;

  /// How full the tables are, for benchmarks.
  struct Load {
    std::size_t buckets = 0;     ///< of one table; 0 while look-ups are linear
    double mean_candidates = 0;  ///< ids a look-up of one of the words reads, mean
    std::size_t left_out = 0;    ///< ids that full buckets refused
  };
  Load load() const;

 private:
  static constexpr std::size_t kLearnAt = 2048;     // words
  static constexpr std::size_t kRemembered = 2048;  // queries of a look-up
  static constexpr std::size_t kGroup = 8;          // look-ups that go side by side
  static constexpr std::size_t kRounds = 4;         // along the links
  static constexpr std::size_t kOpened = 4;         // words whose links a round reads
  static constexpr std::size_t kMaxDistance = 256;  // bits
  static constexpr std::size_t kMostCandidates = WordBuckets::kTables * WordBuckets::kBucket;

  // Of the words met lately by a look-up, so that few are measured twice. It forgets; that costs
  // time only.
  class Met {
   public:
    void start() { ++look_up_; }
    // Whether it is the first time, as far as it remembers.
    bool first_time(std::uint32_t id) {
      std::uint64_t& slot = slots_[(id * 0x9e3779b1U) >> (32 - kSlotBits)];
      const std::uint64_t entry = (look_up_ << 32U) | id;
      return std::exchange(slot, entry) != entry;
    }

   private:
    static constexpr int kSlotBits = 8;
    std::array<std::uint64_t, 1 << kSlotBits> slots_{};
    std::uint64_t look_up_ = 0;
  };

  // One look-up under way.
  struct Search {
    const Descriptor* query = nullptr;
    BestWords best;
    Met met;
    WordBuckets::Places places;
    std::array<std::uint32_t, kOpened> opened;
    std::size_t opened_count = 0;
    std::array<std::uint32_t, kMostCandidates> candidates;
    std::size_t candidate_count = 0;
  };
  // A query of the latest look-up of several with what it found.
  struct Remembered {
    Descriptor query;
    std::array<std::uint32_t, BestWords::kSize> found;
    std::uint32_t count;
  };
  struct Found {
    std::array<std::uint32_t, BestWords::kSize> ids;
    std::size_t count = 0;
  };

  void grow_to(std::size_t ids);
  std::uint32_t take_id(const Descriptor& word) noexcept;
  void put_into_tables(std::uint32_t id) noexcept;
  void learn() noexcept;
  void set_live(std::uint32_t id, bool live) noexcept;
  void connect(std::uint32_t id, const Found& found) noexcept;
  Found recall_or_find(const Descriptor& word) noexcept;

  void scan(Search& search);
  void look_up(std::span<Search> searches);
  void look_into_buckets(std::span<Search> searches);
  void follow_links(std::span<Search> searches);
  void gather_linked(Search& search) const;
  void measure(Search& search);
  std::uint16_t distance_to_keep(const Search& search) const;
  void keep_up_to(std::uint16_t bound, Search& search);

  std::vector<Descriptor, HugePageAllocator<Descriptor>> words_;
  std::vector<WordLinks, HugePageAllocator<WordLinks>> links_;
  std::vector<std::uint64_t> live_;  // a bit a word
  std::size_t size_ = 0;
  std::uint32_t free_ = WordLinks::kNone;  // the id freed last; the others behind it
  WordBuckets buckets_;

  std::vector<Remembered> remembered_;
  std::size_t recalled_ = 0;      // of remembered_, before these a word is not sought
  std::vector<Search> searches_;  // scratch, kGroup of them
  std::array<std::uint16_t, kLearnAt> distances_;
  std::array<std::uint16_t, kMostCandidates + 1> kept_;
};

}  // namespace loopd
