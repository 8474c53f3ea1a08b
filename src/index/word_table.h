#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "index/key_bits.h"
#include "index/neighbours.h"
#include "loopd/features.h"

namespace loopd {

/// Binary words in one flat array, addressed by 32-bit ids (freed ids are reused, the last freed
/// first), with an approximate look-up of the two nearest (DESIGN section 4).
///
/// Up to about kLearnAt[0] words the look-up is a linear scan and exact. From there on every word
/// is in KeyBits::kTables hash tables, each keyed by its own few bits of the descriptor; a look-up
/// measures all words that share a bucket with the query in any table. The tables grow by linear
/// hashing, one bucket a time (Litwin 1980), so that no insertion ever pauses to rebuild; only when
/// the key bits are chosen anew, at kLearnAt words, are the tables made from scratch.
///
/// A bucket is a chain of 64-byte chunks, one cache miss each. It holds at most kMaxBucket ids; a
/// word that finds its bucket full is left out of that table. That bounds the cost of every call on
/// hostile words; on real ones it is rare.
///
/// Deterministic: results depend on the calls made and on nothing else.
/// Thread: one caller at a time (look-ups use scratch memory).
class WordTable {
 public:
  explicit WordTable(std::size_t capacity = 0) { (void)capacity; }
  static std::size_t bytes_for(std::size_t capacity) { return 168 * capacity; }

  /// Makes room for `extra` more words, so that as many insertions cannot fail, and chooses the key
  /// bits when it is time. Throws std::bad_alloc and then changes no result.
  void reserve(std::size_t extra);

  /// Adds a word and returns its id. Equal words may be added. Cost: O(tables).
  /// Precondition: reserve() made room for it.
  std::uint32_t insert(const Descriptor& word) noexcept;

  /// Removes word `id`. Cost: O(tables). Precondition: `id` is of a word.
  void erase(std::uint32_t id) noexcept;

  /// The two nearest words found, by (distance, id); fewer than two if fewer were found. A word
  /// equal to the query is found unless its bucket was full in every table.
  Neighbours two_nearest(const Descriptor& query);

  /// nearest[i] = two_nearest(queries[i]), faster. Sizes are equal.
  void two_nearest(std::span<const Descriptor> queries, std::span<Neighbours> nearest);

  /// Precondition: `id` is of a word.
  const Descriptor& descriptor(std::uint32_t id) const;

  std::size_t size() const { return words_.size() - free_ids_.size(); }
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
  static constexpr std::size_t kTables = KeyBits::kTables;
  static constexpr std::array<std::size_t, 2> kLearnAt = {2048, 16384};
  static constexpr std::size_t kSample = 4096;
  static constexpr std::size_t kIdsPerChunk = 14;
  static constexpr std::size_t kWordsPerBucket = 12;
  static constexpr std::size_t kMaxBucket = 9 * kIdsPerChunk;
  static constexpr std::uint32_t kNone = 0xffffffff;

  // The head of a bucket, or a full chunk behind it: all chunks but the head are always full.
  struct alignas(64) Chunk {
    std::array<std::uint32_t, kIdsPerChunk> ids;
    std::uint32_t total = 0;  // ids in the whole bucket (head only)
    std::uint32_t next = kNone;
  };

  // The hash tables, apart from the words they index.
  struct Tables {
    KeyBits bits;
    std::size_t buckets = 0;     // of each table
    std::vector<Chunk> heads;    // bucket b of table t: heads[b * kTables + t]
    std::vector<Chunk> full;     // chunks behind the heads
    std::uint32_t free = kNone;  // free chunks of `full`, linked
    std::size_t free_count = 0;
  };

  // Where a descriptor's bucket of each table starts: indices into Tables::heads.
  using Heads = std::array<std::uint32_t, kTables>;

  static std::size_t buckets_for(std::size_t words);
  static std::size_t head_occupancy(std::uint32_t total);
  static std::size_t key_bits_in_use(const Tables& tables);
  static std::size_t bucket_of(const Tables& tables, std::uint32_t key);

  static void reserve_chunks(Tables& tables, std::size_t words, std::size_t extra);
  static void put(Tables& tables, Chunk& head, std::uint32_t id) noexcept;
  static void take_last(Tables& tables, Chunk& head) noexcept;
  static void take_out(Tables& tables, Chunk& head, std::uint32_t id) noexcept;
  static void index(Tables& tables, const Descriptor& word, std::uint32_t id) noexcept;
  void split(Tables& tables) const noexcept;
  Tables learn() const;

  Neighbours nearest_by_scan(const Descriptor& query);
  Heads prefetch_buckets(const Descriptor& query) const;
  std::span<const std::uint32_t> collect(const Heads& heads);
  Neighbours nearest_in(const Heads& heads, const Descriptor& query);

  std::vector<Descriptor> words_;
  std::vector<std::uint8_t> live_;  // one byte an id
  std::vector<std::uint32_t> free_ids_;
  Tables tables_;
  std::size_t learned_ = 0;  // how many of kLearnAt are done

  std::vector<std::uint32_t> candidates_;  // scratch
  std::vector<std::uint16_t> distances_;
};

}  // namespace loopd
