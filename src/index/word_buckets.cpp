#include "index/word_buckets.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstring>
#include <utility>

namespace loopd {

std::size_t WordBuckets::Bucket::size() const {
  std::uint32_t size = 0;  // all are counted: without a branch, several at a time
  for (const std::uint32_t id : ids) size += id != kNone ? 1 : 0;
  return size;
}

void WordBuckets::Bucket::add(std::uint32_t id) {
  const std::size_t used = size();
  if (used < kBucket) ids[used] = id;
}

// The last takes the place of the removed.
void WordBuckets::Bucket::remove(std::uint32_t id) {
  const auto at = std::find(ids.begin(), ids.end(), id);
  if (at == ids.end()) return;  // the bucket was full when it came
  const std::size_t last = size() - 1;
  *at = ids[last];
  ids[last] = kNone;
}

// ---- Linear hashing

std::size_t WordBuckets::buckets_for(std::size_t words) {
  const std::size_t wanted = (words + kWordsPerBucket - 1) / kWordsPerBucket;
  return std::clamp<std::size_t>(wanted, 1, std::size_t{1} << KeyBits::kMaxBits);
}

std::size_t WordBuckets::bits_in_use() const {
  return static_cast<std::size_t>(std::bit_width(buckets_ - 1));
}

// With 2^b + s buckets (s < 2^b), the first s buckets of the lower 2^b have been split.
std::size_t WordBuckets::bucket_of(std::uint32_t key) const {
  return key < buckets_ ? key : key & (std::bit_floor(buckets_) - 1);
}

// Adds one bucket to every table and moves there what belongs there of the bucket it is split from.
void WordBuckets::split(std::span<const Descriptor> words) noexcept {
  const std::size_t added = buckets_++;
  const auto bit = static_cast<std::size_t>(std::bit_width(added) - 1);
  const std::size_t source = added - std::bit_floor(added);
  assert(buckets_ * kTables <= lines_.capacity());
  lines_.resize(buckets_ * kTables);
  for (std::size_t table = 0; table < kTables; ++table)
    for (const std::uint32_t id : lines_[source * kTables + table].ids)
      if (id != kNone) __builtin_prefetch(&words[id]);
  for (std::size_t table = 0; table < kTables; ++table) {
    Bucket& stays = lines_[source * kTables + table];
    Bucket& moves = lines_[added * kTables + table];
    const auto ids = std::exchange(stays, Bucket{}).ids;
    std::size_t left[2] = {0, 0};
    for (const std::uint32_t id : ids) {
      if (id == kNone) break;
      const bool moved = bits_.bit(words[id], table, bit);
      (moved ? moves : stays).ids[left[moved ? 1 : 0]++] = id;
    }
  }
}

// ---- Memory

void WordBuckets::reserve(std::size_t words) {
  if (!ready() && workspace_ == nullptr)
    workspace_ = std::make_unique_for_overwrite<KeyBits::Workspace>();
  lines_.reserve(std::max(buckets_, buckets_for(words)) * kTables);
}

std::size_t WordBuckets::bytes_for(std::size_t words) {
  return buckets_for(words) * kTables * sizeof(Bucket) + sizeof(KeyBits::Workspace);
}

std::size_t WordBuckets::bytes() const {
  return lines_.capacity() * sizeof(Bucket) +
         (workspace_ != nullptr ? sizeof(KeyBits::Workspace) : 0);
}

// ---- Words

void WordBuckets::learn(std::span<const Descriptor> sample, std::size_t size) noexcept {
  assert(!ready() && workspace_ != nullptr);
  bits_ = KeyBits(sample, *workspace_);
  workspace_.reset();
  buckets_ = buckets_for(size);
  assert(buckets_ * kTables <= lines_.capacity());
  lines_.resize(buckets_ * kTables);
}

WordBuckets::Places WordBuckets::locate(const Descriptor& query) const {
  const auto keys = bits_.keys(query, bits_in_use());
  Places places;
  for (std::size_t table = 0; table < kTables; ++table) {
    const std::size_t place = bucket_of(keys[table]) * kTables + table;
    __builtin_prefetch(&lines_[place]);
    places[table] = static_cast<std::uint32_t>(place);
  }
  return places;
}

void WordBuckets::put(std::span<const Descriptor> words, std::uint32_t id,
                      std::size_t size) noexcept {
  if (buckets_ < buckets_for(size)) split(words);
  for (const std::uint32_t place : locate(words[id])) lines_[place].add(id);
}

void WordBuckets::take(const Descriptor& word, std::uint32_t id) noexcept {
  for (const std::uint32_t place : locate(word)) lines_[place].remove(id);
}

std::size_t WordBuckets::collect(const Places& places,
                                 std::span<std::uint32_t, kTables * kBucket> ids) const {
  std::uint32_t* end = ids.data();
  for (const std::uint32_t place : places) {
    const Bucket& bucket = lines_[place];
    std::memcpy(end, bucket.ids.data(), sizeof(bucket.ids));  // all: a fixed length is faster
    end += bucket.size();
  }
  return static_cast<std::size_t>(end - ids.data());
}

// ---- Figures

std::size_t WordBuckets::held() const {
  std::size_t held = 0;
  for (const Bucket& bucket : lines_) held += bucket.size();
  return held;
}

double WordBuckets::mean_candidates() const {
  double read = 0;
  for (const Bucket& bucket : lines_) {
    const auto size = static_cast<double>(bucket.size());
    read += size * size;
  }
  const std::size_t ids = held();
  return ids == 0 ? 0 : read / static_cast<double>(ids) * kTables;
}

}  // namespace loopd
