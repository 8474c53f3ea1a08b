#include "index/word_table.h"

#include <algorithm>
#include <bit>
#include <cassert>

#include "base/hamming.h"

namespace loopd {
namespace {

// Grows `v`'s capacity to at least `needed`, by a quarter at least when it grows at all: the copies
// stay O(1) an element, and little is held in vain.
template <class T>
void reserve_amortised(std::vector<T>& v, std::size_t needed) {
  if (needed > v.capacity()) v.reserve(std::max(needed, v.capacity() + v.capacity() / 4));
}

// The smaller of two (distance, id) pairs, kept as one integer: distance above, id below.
constexpr std::uint64_t kNothing = ~std::uint64_t{0};
constexpr int kIdBits = 32;

std::optional<Neighbour> unpack(std::uint64_t packed) {
  if (packed == kNothing) return std::nullopt;
  return Neighbour{static_cast<std::uint32_t>(packed), static_cast<int>(packed >> kIdBits)};
}

// The two smallest of what is offered; the same word offered twice counts once.
class TwoSmallest {
 public:
  void offer(std::uint32_t id, std::uint16_t bits) {
    if (bits > bound_) return;
    const std::uint64_t packed = (std::uint64_t{bits} << kIdBits) | id;
    if (packed < first_) {
      second_ = first_;
      first_ = packed;
    } else if (packed != first_ && packed < second_) {
      second_ = packed;
    }
    bound_ = second_ >> kIdBits;
  }

  Neighbours get() const { return {unpack(first_), unpack(second_)}; }

 private:
  std::uint64_t first_ = kNothing;
  std::uint64_t second_ = kNothing;
  std::uint64_t bound_ = kNothing >> kIdBits;
};

}  // namespace

// ---- The tables: linear hashing over chains of chunks

std::size_t WordTable::buckets_for(std::size_t words) {
  const std::size_t wanted = (words + kWordsPerBucket - 1) / kWordsPerBucket;
  return std::clamp<std::size_t>(wanted, 1, std::size_t{1} << KeyBits::kMaxBits);
}

// How many of a bucket's ids are in its head; the chunks behind are full.
std::size_t WordTable::head_occupancy(std::uint32_t total) {
  return total == 0 ? 0 : (total - 1) % kIdsPerChunk + 1;
}

// With 2^b + s buckets (s < 2^b), the first s buckets of the lower 2^b have been split.
std::size_t WordTable::bucket_of(const Tables& tables, std::uint32_t key) {
  return key < tables.buckets ? key : key & (std::bit_floor(tables.buckets) - 1);
}

std::size_t WordTable::key_bits_in_use(const Tables& tables) {
  return static_cast<std::size_t>(std::bit_width(tables.buckets - 1));
}

// Room for `extra` words more than the `words` there are.
void WordTable::reserve_chunks(Tables& tables, std::size_t words, std::size_t extra) {
  reserve_amortised(tables.heads, std::max(tables.buckets, buckets_for(words + extra)) * kTables);
  // Chunks behind the heads are full, which bounds their number by that of the ids; and a word adds
  // at most one a table. A split adds none.
  const std::size_t in_use = tables.full.size() - tables.free_count;
  const std::size_t behind =
      std::min((words + extra) * kTables / kIdsPerChunk, in_use + extra * kTables);
  reserve_amortised(tables.full, std::max(behind, tables.full.size()));
}

void WordTable::put(Tables& tables, Chunk& head, std::uint32_t id) noexcept {
  if (head.total >= kMaxBucket) return;
  std::size_t used = head_occupancy(head.total);
  if (used == kIdsPerChunk) {
    std::uint32_t moved = tables.free;
    if (moved == kNone) {
      assert(tables.full.size() < tables.full.capacity());
      moved = static_cast<std::uint32_t>(tables.full.size());
      tables.full.push_back(head);
    } else {
      tables.free = tables.full[moved].next;
      --tables.free_count;
      tables.full[moved] = head;
    }
    head.next = moved;
    used = 0;
  }
  head.ids[used] = id;
  ++head.total;
}

// Drops the last id of the head. If it was the only one, the chunk behind becomes the head.
void WordTable::take_last(Tables& tables, Chunk& head) noexcept {
  const bool emptied = head_occupancy(head.total) == 1;
  --head.total;
  if (!emptied || head.next == kNone) return;
  const std::uint32_t behind = head.next;
  head.ids = tables.full[behind].ids;
  head.next = tables.full[behind].next;
  tables.full[behind].next = tables.free;
  tables.free = behind;
  ++tables.free_count;
}

// Drops `id`, if it is there, by putting the last id of the head in its place.
void WordTable::take_out(Tables& tables, Chunk& head, std::uint32_t id) noexcept {
  const std::size_t used = head_occupancy(head.total);
  Chunk* chunk = &head;
  std::size_t at = 0;
  for (std::size_t in_chunk = used;; in_chunk = kIdsPerChunk) {
    at = static_cast<std::size_t>(std::find(chunk->ids.begin(), chunk->ids.begin() + in_chunk, id) -
                                  chunk->ids.begin());
    if (at < in_chunk) break;
    if (chunk->next == kNone) return;  // its bucket was full when it came
    chunk = &tables.full[chunk->next];
  }
  chunk->ids[at] = head.ids[used - 1];
  take_last(tables, head);
}

void WordTable::index(Tables& tables, const Descriptor& word, std::uint32_t id) noexcept {
  const auto keys = tables.bits.keys(word, key_bits_in_use(tables));
  for (std::size_t table = 0; table < kTables; ++table)
    __builtin_prefetch(&tables.heads[bucket_of(tables, keys[table]) * kTables + table], 1);
  for (std::size_t table = 0; table < kTables; ++table)
    put(tables, tables.heads[bucket_of(tables, keys[table]) * kTables + table], id);
}

// Adds one bucket to every table and moves there what belongs there of the bucket it is split from.
void WordTable::split(Tables& tables) const noexcept {
  const std::size_t added = tables.buckets;
  const auto bit = static_cast<std::size_t>(std::bit_width(added) - 1);
  const std::size_t source = added - std::bit_floor(added);
  assert((added + 1) * kTables <= tables.heads.capacity());
  tables.heads.resize((added + 1) * kTables);
  tables.buckets = added + 1;
  for (std::size_t table = 0; table < kTables; ++table) {
    std::array<std::uint32_t, kMaxBucket> ids;
    std::size_t count = 0;
    Chunk& head = tables.heads[source * kTables + table];
    while (head.total > 0) {
      const std::uint32_t id = head.ids[head_occupancy(head.total) - 1];
      __builtin_prefetch(&words_[id]);
      ids[count++] = id;
      take_last(tables, head);
    }
    for (std::size_t i = 0; i < count; ++i) {
      const bool moves = tables.bits.bit(words_[ids[i]], table, bit);
      put(tables, moves ? tables.heads[added * kTables + table] : head, ids[i]);
    }
  }
}

// Tables with newly chosen key bits, holding all words.
WordTable::Tables WordTable::learn() const {
  std::vector<Descriptor> sample;
  const std::size_t step = std::max<std::size_t>(1, words_.size() / kSample);
  sample.reserve(words_.size() / step + 1);
  for (std::size_t id = 0; id < words_.size(); id += step)
    if (live_[id] != 0) sample.push_back(words_[id]);
  if (sample.empty()) sample.push_back(Descriptor{});

  Tables tables;
  tables.bits = KeyBits(sample);
  tables.buckets = buckets_for(size());
  reserve_chunks(tables, 0, size());
  tables.heads.resize(tables.buckets * kTables);
  for (std::uint32_t id = 0; id < words_.size(); ++id)
    if (live_[id] != 0) index(tables, words_[id], id);
  return tables;
}

// ---- Words

void WordTable::reserve(std::size_t extra) {
  const std::size_t ids = words_.size() + extra - std::min(extra, free_ids_.size());
  assert(ids < kNone);
  reserve_amortised(words_, ids);
  reserve_amortised(live_, ids);
  reserve_amortised(free_ids_, ids);
  if (candidates_.empty()) candidates_.resize(kTables * kMaxBucket + kIdsPerChunk);
  // A linear scan measures every id; it ends at the next call once kLearnAt[0] words are there.
  const std::size_t measured = learned_ == 0 ? ids : 0;
  distances_.resize(std::max({distances_.size(), candidates_.size(), measured}));
  if (learned_ < kLearnAt.size() && size() >= kLearnAt[learned_]) {
    Tables learned = learn();
    reserve_chunks(learned, size(), extra);
    tables_ = std::move(learned);
    while (learned_ < kLearnAt.size() && size() >= kLearnAt[learned_]) ++learned_;
  } else if (learned_ > 0) {
    reserve_chunks(tables_, size(), extra);
  }
}

std::uint32_t WordTable::insert(const Descriptor& word) noexcept {
  std::uint32_t id = 0;
  if (free_ids_.empty()) {
    assert(words_.size() < words_.capacity());
    id = static_cast<std::uint32_t>(words_.size());
    words_.push_back(word);
    live_.push_back(1);
  } else {
    id = free_ids_.back();
    free_ids_.pop_back();
    words_[id] = word;
    live_[id] = 1;
  }
  if (learned_ > 0) {
    if (tables_.buckets < buckets_for(size())) split(tables_);
    index(tables_, word, id);
  }
  return id;
}

void WordTable::erase(std::uint32_t id) noexcept {
  assert(id < words_.size() && live_[id] != 0);
  if (learned_ > 0) {
    const auto heads = prefetch_buckets(words_[id]);
    for (const std::uint32_t head : heads) take_out(tables_, tables_.heads[head], id);
  }
  live_[id] = 0;
  free_ids_.push_back(id);
}

const Descriptor& WordTable::descriptor(std::uint32_t id) const {
  assert(id < words_.size() && live_[id] != 0);
  return words_[id];
}

// ---- Look-ups

Neighbours WordTable::nearest_by_scan(const Descriptor& query) {
  const std::span<std::uint16_t> distances(distances_.data(), words_.size());
  hamming_distances(query, words_, distances);
  TwoSmallest nearest;
  for (std::uint32_t id = 0; id < words_.size(); ++id)
    if (live_[id] != 0) nearest.offer(id, distances[id]);
  return nearest.get();
}

WordTable::Heads WordTable::prefetch_buckets(const Descriptor& query) const {
  const auto keys = tables_.bits.keys(query, key_bits_in_use(tables_));
  Heads heads;
  for (std::size_t table = 0; table < kTables; ++table) {
    const std::size_t head = bucket_of(tables_, keys[table]) * kTables + table;
    __builtin_prefetch(&tables_.heads[head]);
    heads[table] = static_cast<std::uint32_t>(head);
  }
  return heads;
}

// The ids in all these buckets, into candidates_: first the heads, then what is one behind, and so
// on, so that a chunk is on its way while the others of its row are read.
std::span<const std::uint32_t> WordTable::collect(const Heads& heads) {
  std::array<std::uint32_t, kTables> row;
  std::size_t in_row = 0;
  std::uint32_t* end = candidates_.data();
  const auto follow = [&](const Chunk& chunk, std::size_t used) {
    std::copy_n(chunk.ids.begin(), kIdsPerChunk, end);  // a fixed length is faster
    // Into the second-level cache: all candidates of a query do not fit into the first.
    for (std::size_t i = 0; i < used; ++i) __builtin_prefetch(&words_[chunk.ids[i]], 0, 2);
    end += used;
    if (chunk.next == kNone) return;
    __builtin_prefetch(&tables_.full[chunk.next]);
    row[in_row++] = chunk.next;
  };
  for (const std::uint32_t head : heads)
    follow(tables_.heads[head], head_occupancy(tables_.heads[head].total));
  while (in_row > 0) {
    const std::size_t last_row = in_row;
    in_row = 0;
    for (std::size_t i = 0; i < last_row; ++i) follow(tables_.full[row[i]], kIdsPerChunk);
  }
  return {candidates_.data(), end};
}

Neighbours WordTable::nearest_in(const Heads& heads, const Descriptor& query) {
  // A word met in several tables is measured as often: cheaper than to find out.
  const auto ids = collect(heads);
  const std::span<std::uint16_t> distances(distances_.data(), ids.size());
  hamming_distances_at(query, words_.data(), ids, distances);
  TwoSmallest nearest;
  for (std::size_t i = 0; i < ids.size(); ++i) nearest.offer(ids[i], distances[i]);
  return nearest.get();
}

Neighbours WordTable::two_nearest(const Descriptor& query) {
  return learned_ == 0 ? nearest_by_scan(query) : nearest_in(prefetch_buckets(query), query);
}

void WordTable::two_nearest(std::span<const Descriptor> queries, std::span<Neighbours> nearest) {
  assert(queries.size() == nearest.size());
  if (queries.empty()) return;
  if (learned_ == 0) {
    for (std::size_t i = 0; i < queries.size(); ++i) nearest[i] = nearest_by_scan(queries[i]);
    return;
  }
  Heads next = prefetch_buckets(queries[0]);
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Heads heads = next;
    if (i + 1 < queries.size()) next = prefetch_buckets(queries[i + 1]);
    nearest[i] = nearest_in(heads, queries[i]);
  }
}

// ---- Figures

std::size_t WordTable::bytes() const {
  return words_.capacity() * sizeof(Descriptor) + live_.capacity() +
         free_ids_.capacity() * sizeof(std::uint32_t) +
         (tables_.heads.capacity() + tables_.full.capacity()) * sizeof(Chunk) +
         candidates_.capacity() * sizeof(std::uint32_t) +
         distances_.capacity() * sizeof(std::uint16_t);
}

WordTable::Load WordTable::load() const {
  if (learned_ == 0) return {0, static_cast<double>(words_.size()), 0};
  Load load;
  load.buckets = tables_.buckets;
  std::size_t held = 0;
  double read = 0;
  for (const Chunk& head : tables_.heads) {
    held += head.total;
    read += static_cast<double>(head.total) * static_cast<double>(head.total);
  }
  if (size() > 0) load.mean_candidates = read / static_cast<double>(size());
  load.left_out = size() * kTables - held;
  return load;
}

}  // namespace loopd
