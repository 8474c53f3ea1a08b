#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/huge_pages.h"
#include "index/key_bits.h"
#include "loopd/features.h"

namespace loopd {

/// KeyBits::kTables hash tables over the words of WordTable, each keyed by its own few bits of the
/// descriptor. They answer "which words may be near?".
///
/// A bucket is one cache line of kBucket ids. A word that finds its bucket full is left out of that
/// table, about every second time: most tables have room for it, and where words are so dense that
/// few have, WordLinks leads on. So every call's cost is bounded, whatever the words, and memory is
/// a function of the number of words alone.
///
/// The tables grow by linear hashing, one bucket a time (Litwin 1980): no insertion pauses to
/// rebuild. They never shrink.
///
/// Deterministic. Thread: one caller at a time.
class WordBuckets {
 public:
  static constexpr std::size_t kTables = KeyBits::kTables;
  static constexpr std::size_t kBucket = 16;
  static constexpr std::size_t kWordsPerBucket = 16;  ///< mean, had all words room
  static constexpr std::uint32_t kNone = 0xffffffff;

  /// Where a descriptor's bucket of each table is.
  using Places = std::array<std::uint32_t, kTables>;

  /// Makes room for `words` words: learn() and as many put() allocate nothing then.
  /// Throws std::bad_alloc and then has changed nothing that can be seen.
  void reserve(std::size_t words);
  static std::size_t bytes_for(std::size_t words);
  std::size_t bytes() const;

  /// Whether the key bits are chosen. Before, nothing else may be called.
  bool ready() const { return buckets_ > 0; }
  /// Chooses the key bits for `sample`, for the tables to start with `size` words, and frees what
  /// that took.
  void learn(std::span<const Descriptor> sample, std::size_t size) noexcept;

  /// Adds word `id` to the tables. `words` are all, by id; `size` is how many there are with it.
  void put(std::span<const Descriptor> words, std::uint32_t id, std::size_t size) noexcept;
  /// Removes word `id`, whose descriptor is `word`, from the tables that have it.
  void take(const Descriptor& word, std::uint32_t id) noexcept;

  /// The buckets of `query`, under way into the cache.
  Places locate(const Descriptor& query) const;
  /// The ids in these buckets, some more than once, into `ids`; returns how many.
  std::size_t collect(const Places& places, std::span<std::uint32_t, kTables * kBucket> ids) const;

  std::size_t buckets() const { return buckets_; }  ///< of each table
  std::size_t held() const;                         ///< ids in all tables, O(buckets)
  double mean_candidates() const;  ///< ids a look-up of one of the held words reads, mean

 private:
  // Ids from the front; kNone behind them.
  struct alignas(64) Bucket {
    std::array<std::uint32_t, kBucket> ids;
    Bucket() { ids.fill(kNone); }
    std::size_t size() const;
    void add(std::uint32_t id);
    void remove(std::uint32_t id);
  };

  static std::size_t buckets_for(std::size_t words);
  std::size_t bits_in_use() const;
  std::size_t bucket_of(std::uint32_t key) const;
  void split(std::span<const Descriptor> words) noexcept;

  KeyBits bits_;
  std::size_t buckets_ = 0;  // of each table
  std::vector<Bucket, HugePageAllocator<Bucket>>
      lines_;                                      // bucket b of table t: lines_[b * kTables + t]
  std::unique_ptr<KeyBits::Workspace> workspace_;  // until learn()
};

}  // namespace loopd
