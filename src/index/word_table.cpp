#include "index/word_table.h"

#include <algorithm>
#include <cassert>

#include "base/hamming.h"

namespace loopd {
namespace {

// Grows `v`'s capacity to at least `needed`, by a quarter at least when it grows at all: the copies
// stay O(1) an element, and little is held in vain.
std::size_t amortised(std::size_t capacity, std::size_t needed) {
  return capacity == 0 ? needed : std::max(needed, capacity + capacity / 4);
}

}  // namespace

// ---- Memory

WordTable::WordTable() : searches_(kGroup) {}

WordTable::WordTable(std::size_t capacity) : WordTable() {
  remembered_.reserve(kRemembered);
  grow_to(capacity);
}

std::size_t WordTable::bytes_for(std::size_t capacity) {
  return capacity * (sizeof(Descriptor) + sizeof(WordLinks)) +
         (capacity + 63) / 64 * sizeof(std::uint64_t) + WordBuckets::bytes_for(capacity) +
         kRemembered * sizeof(Remembered) + kGroup * sizeof(Search);
}

std::size_t WordTable::bytes() const {
  return words_.capacity() * sizeof(Descriptor) + links_.capacity() * sizeof(WordLinks) +
         live_.capacity() * sizeof(std::uint64_t) + buckets_.bytes() +
         remembered_.capacity() * sizeof(Remembered) + searches_.capacity() * sizeof(Search);
}

void WordTable::grow_to(std::size_t ids) {
  assert(ids < WordLinks::kNone - 1);
  words_.reserve(ids);
  links_.reserve(ids);
  live_.reserve((ids + 63) / 64);
  buckets_.reserve(ids);
}

void WordTable::reserve(std::size_t extra) {
  const std::size_t ids = std::max(words_.size(), size_ + extra);
  if (ids > words_.capacity()) grow_to(amortised(words_.capacity(), ids));
}

// ---- Words

std::uint32_t WordTable::insert(const Descriptor& word) noexcept {
  const Found found = recall_or_find(word);
  const std::uint32_t id = take_id(word);
  put_into_tables(id);
  connect(id, found);
  return id;
}

std::uint32_t WordTable::take_id(const Descriptor& word) noexcept {
  ++size_;
  std::uint32_t id = free_;
  if (id == WordLinks::kNone) {
    assert(words_.size() < words_.capacity());
    id = static_cast<std::uint32_t>(words_.size());
    words_.push_back(word);
    links_.emplace_back();
    if (id % 64 == 0) live_.push_back(0);
  } else {
    free_ = links_[id].next_free();
    words_[id] = word;
  }
  links_[id].clear();
  set_live(id, true);
  return id;
}

void WordTable::put_into_tables(std::uint32_t id) noexcept {
  if (buckets_.ready())
    buckets_.put(words_, id, size_);
  else if (size_ >= kLearnAt)
    learn();
}

// Until here no id was given while one was free, so that there are kLearnAt, all of words.
void WordTable::learn() noexcept {
  buckets_.learn(words_, size_);
  for (std::uint32_t id = 0; id < words_.size(); ++id) buckets_.put(words_, id, size_);
}

void WordTable::set_live(std::uint32_t id, bool live) noexcept {
  const std::uint64_t bit = std::uint64_t{1} << (id % 64);
  live_[id / 64] = live ? live_[id / 64] | bit : live_[id / 64] & ~bit;
}

// Links `id` with the nearest found. Some of them may be gone by now.
void WordTable::connect(std::uint32_t id, const Found& found) noexcept {
  for (std::size_t i = 0; i < found.count; ++i) {
    __builtin_prefetch(&links_[found.ids[i]], 1);
    __builtin_prefetch(&words_[found.ids[i]]);
  }
  std::size_t left = WordLinks::kLinks;
  for (std::size_t i = 0; i < found.count && left > 0; ++i) {
    const std::uint32_t other = found.ids[i];
    if (other == id || !live(other)) continue;
    const int distance_bits = hamming_distance(words_[id], words_[other]);
    links_[id].link(other, distance_bits);
    links_[other].link(id, distance_bits);
    --left;
  }
}

void WordTable::erase(std::uint32_t id) noexcept {
  assert(id < words_.size() && live(id));
  for (const std::uint32_t other : links_[id].ids())
    if (other != WordLinks::kNone) __builtin_prefetch(&links_[other], 1);
  if (buckets_.ready()) buckets_.take(words_[id], id);
  for (const std::uint32_t other : links_[id].ids())
    if (other != WordLinks::kNone) links_[other].unlink(id);
  links_[id].set_next_free(free_);
  set_live(id, false);
  free_ = id;
  --size_;
}

const Descriptor& WordTable::descriptor(std::uint32_t id) const {
  assert(id < words_.size() && live(id));
  return words_[id];
}

// What is near a word about to be inserted. A vocabulary has just looked it up among others, in the
// same order.
WordTable::Found WordTable::recall_or_find(const Descriptor& word) noexcept {
  Found found;
  for (std::size_t i = recalled_; i < remembered_.size(); ++i) {
    if (remembered_[i].query != word) continue;
    recalled_ = i + 1;
    found.ids = remembered_[i].found;
    found.count = remembered_[i].count;
    return found;
  }
  searches_[0].query = &word;
  look_up(std::span(searches_).first(1));
  found.count = searches_[0].best.ids(found.ids);
  return found;
}

// ---- Look-ups

Neighbours WordTable::two_nearest(const Descriptor& query) {
  searches_[0].query = &query;
  look_up(std::span(searches_).first(1));
  return searches_[0].best.two_nearest();
}

void WordTable::two_nearest(std::span<const Descriptor> queries, std::span<Neighbours> nearest) {
  assert(queries.size() == nearest.size());
  remembered_.resize(std::min(queries.size(), kRemembered));
  recalled_ = 0;
  for (std::size_t start = 0; start < queries.size(); start += kGroup) {
    const std::size_t count = std::min(kGroup, queries.size() - start);
    for (std::size_t i = 0; i < count; ++i) searches_[i].query = &queries[start + i];
    look_up(std::span(searches_).first(count));
    for (std::size_t i = 0; i < count; ++i) {
      nearest[start + i] = searches_[i].best.two_nearest();
      if (start + i >= remembered_.size()) continue;
      Remembered& memory = remembered_[start + i];
      memory.query = queries[start + i];
      memory.count = static_cast<std::uint32_t>(searches_[i].best.ids(memory.found));
    }
  }
}

// The look-ups go side by side, a step of each before the next step of any, so that what one has
// asked memory for arrives while the others compute.
void WordTable::look_up(std::span<Search> searches) {
  for (Search& search : searches) {
    search.best = BestWords();
    search.met.start();
  }
  if (!buckets_.ready()) {
    for (Search& search : searches) scan(search);
    return;
  }
  look_into_buckets(searches);
  for (std::size_t round = 0; round < kRounds; ++round) follow_links(searches);
}

void WordTable::scan(Search& search) {
  const auto distances = std::span(distances_).first(words_.size());
  hamming_distances(*search.query, words_, distances);
  for (std::uint32_t id = 0; id < words_.size(); ++id)
    if (live(id)) search.best.offer(id, distances[id]);
}

void WordTable::look_into_buckets(std::span<Search> searches) {
  for (Search& search : searches) search.places = buckets_.locate(*search.query);
  for (Search& search : searches) {
    search.candidate_count = buckets_.collect(search.places, search.candidates);
    // Into the second-level cache: those of all do not fit into the first.
    for (std::size_t i = 0; i < search.candidate_count; ++i)
      __builtin_prefetch(&words_[search.candidates[i]], 0, 2);
  }
  for (Search& search : searches) {
    measure(search);
    keep_up_to(distance_to_keep(search), search);
  }
}

void WordTable::follow_links(std::span<Search> searches) {
  for (Search& search : searches) {
    search.opened_count = search.best.open(search.opened);
    for (std::size_t i = 0; i < search.opened_count; ++i) {
      __builtin_prefetch(&links_[search.opened[i]]);
      search.met.first_time(search.opened[i]);
    }
  }
  for (Search& search : searches) gather_linked(search);
  for (Search& search : searches) {
    measure(search);
    keep_up_to(search.best.bound(), search);
  }
}

// Without branches: whether a word was met is a coin's throw.
void WordTable::gather_linked(Search& search) const {
  std::size_t count = 0;
  for (std::size_t i = 0; i < search.opened_count; ++i)
    for (const std::uint32_t id : links_[search.opened[i]].ids()) {
      __builtin_prefetch(words_.data() + id);
      search.candidates[count] = id;
      count += search.met.first_time(id) && id != WordLinks::kNone ? 1 : 0;
    }
  search.candidate_count = count;
}

// A word met several times is measured as often: cheaper than to find out.
void WordTable::measure(Search& search) {
  const auto ids = std::span<const std::uint32_t>(search.candidates).first(search.candidate_count);
  hamming_distances_at(*search.query, words_.data(), ids, std::span(distances_).first(ids.size()));
}

// Of several hundred, most of the nearest would be taken for a while, each at the cost of a branch
// not foreseen and a place in order. So the distance of the kSize-th nearest is found by counting
// before any is taken.
std::uint16_t WordTable::distance_to_keep(const Search& search) const {
  std::array<std::uint16_t, kMaxDistance + 1> counts{};
  for (std::size_t i = 0; i < search.candidate_count; ++i) ++counts[distances_[i]];
  std::uint16_t bound = 0;
  for (std::size_t seen = counts[0]; seen < BestWords::kSize && bound < kMaxDistance;)
    seen += counts[++bound];
  return bound;
}

void WordTable::keep_up_to(std::uint16_t bound, Search& search) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < search.candidate_count; ++i) {
    kept_[kept] = static_cast<std::uint16_t>(i);
    kept += distances_[i] <= bound ? 1 : 0;
  }
  for (std::size_t i = 0; i < kept; ++i) {
    const std::uint32_t id = search.candidates[kept_[i]];
    if (live(id)) search.best.offer(id, distances_[kept_[i]]);
  }
}

// ---- Figures

WordTable::Load WordTable::load() const {
  if (!buckets_.ready()) return {0, static_cast<double>(words_.size()), 0};
  return {buckets_.buckets(), buckets_.mean_candidates(),
          size() * WordBuckets::kTables - buckets_.held()};
}

}  // namespace loopd
