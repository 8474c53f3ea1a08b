#include "verify/distance_rows.h"

#include <algorithm>
#include <array>

#include "base/hamming.h"

#if defined(__x86_64__)
// g++ 12 takes the deliberately undefined operands inside these intrinsics for mistakes (bug
// 105593).
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#include <immintrin.h>
#endif

namespace loopd {
namespace {

using BestTwo = DistanceRows::BestTwo;

constexpr std::size_t kMostLanes = 8;

struct Forms {
  std::array<RowForm, 3> list{};
  std::size_t count = 0;

  Forms() {
    list[count++] = RowForm::kGeneric;
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (!__builtin_cpu_supports("avx2")) return;
    list[count++] = RowForm::kAvx2;
    if (__builtin_cpu_supports("avx512vpopcntdq") && __builtin_cpu_supports("avx512f") &&
        __builtin_cpu_supports("avx512bw"))
      list[count++] = RowForm::kAvx512;
#endif
  }
};

const Forms& forms() {
  static const Forms instance;
  return instance;
}

BestTwo scan(std::span<const std::uint16_t> row, std::span<std::uint16_t> columns, BestTwo best) {
  for (std::size_t i = 0; i < row.size(); ++i) {
    best.add(row[i]);
    columns[i] = std::min(columns[i], row[i]);
  }
  return best;
}

}  // namespace

std::span<const RowForm> row_forms() { return {forms().list.data(), forms().count}; }

void DistanceRows::assign(std::span<const Descriptor> others) {
  others_ = others;
  padded_ = (others.size() + 4 * kMostLanes - 1) / (4 * kMostLanes) * (4 * kMostLanes);
  row_.resize(padded_);
  columns_.assign(padded_, kFar);
#if defined(__x86_64__)
  if (form_ == RowForm::kAvx512) transpose(8);
  if (form_ == RowForm::kAvx2) transpose(4);
#endif
}

BestTwo DistanceRows::compute(const Descriptor& query) {
#if defined(__x86_64__)
  if (form_ == RowForm::kAvx512) return compute_avx512(query);
  if (form_ == RowForm::kAvx2) return compute_avx2(query);
#endif
  return compute_generic(query);
}

BestTwo DistanceRows::compute_generic(const Descriptor& query) {
  const std::span<std::uint16_t> row(row_.data(), others_.size());
  hamming_distances(query, others_, row);
  return scan(row, {columns_.data(), row.size()}, {});
}

#if defined(__x86_64__)

// A block is 4 vectors of `lanes` descriptors. Lane l of vector s holds the block's descriptor
// 4 l + s, so that the four sums of a lane, 16 bits each in one 64-bit integer, are four distances
// in a row: nothing has to be shuffled.
void DistanceRows::transpose(std::size_t lanes) {
  words_.assign(4 * padded_, 0);
  for (std::size_t i = 0; i < others_.size(); ++i) {
    const std::size_t in_block = i % (4 * lanes);
    const std::size_t place = i - in_block + in_block % 4 * lanes + in_block / 4;
    for (std::size_t k = 0; k < 4; ++k) words_[k * padded_ + place] = others_[i].words[k];
  }
}

__attribute__((target("avx2"))) BestTwo DistanceRows::compute_avx2(const Descriptor& query) {
  const __m256i table = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4,  //
                                         0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4);
  const __m256i nibble = _mm256_set1_epi8(15);
  __m256i q[4];
  for (std::size_t k = 0; k < 4; ++k)
    q[k] = _mm256_set1_epi64x(static_cast<long long>(query.words[k]));
  __m256i first = _mm256_set1_epi16(kFar), second = first;
  const std::size_t whole = others_.size() / 16 * 16;
  for (std::size_t i = 0; i < padded_; i += 16) {
    __m256i distances = _mm256_setzero_si256();
    for (int s = 3; s >= 0; --s) {
      __m256i bytes = _mm256_setzero_si256();
      for (std::size_t k = 0; k < 4; ++k) {
        const std::uint64_t* const at = &words_[k * padded_ + i + static_cast<std::size_t>(s) * 4];
        const __m256i x =
            _mm256_xor_si256(q[k], _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at)));
        const __m256i low = _mm256_and_si256(x, nibble);
        const __m256i high = _mm256_and_si256(_mm256_srli_epi16(x, 4), nibble);
        bytes = _mm256_add_epi8(bytes, _mm256_shuffle_epi8(table, low));
        bytes = _mm256_add_epi8(bytes, _mm256_shuffle_epi8(table, high));
      }
      const __m256i sums = _mm256_sad_epu8(bytes, _mm256_setzero_si256());
      distances = _mm256_or_si256(_mm256_slli_epi64(distances, 16), sums);
    }
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(&row_[i]), distances);
    if (i >= whole) continue;
    auto* const columns = reinterpret_cast<__m256i*>(&columns_[i]);
    _mm256_storeu_si256(columns, _mm256_min_epu16(_mm256_loadu_si256(columns), distances));
    second = _mm256_min_epu16(second, _mm256_max_epu16(first, distances));
    first = _mm256_min_epu16(first, distances);
  }
  alignas(32) std::array<std::uint16_t, 16> firsts, seconds;
  _mm256_store_si256(reinterpret_cast<__m256i*>(firsts.data()), first);
  _mm256_store_si256(reinterpret_cast<__m256i*>(seconds.data()), second);
  BestTwo best;
  for (std::size_t lane = 0; lane < firsts.size(); ++lane) {
    best.add(firsts[lane]);
    best.add(seconds[lane]);
  }
  return scan(row().subspan(whole), std::span(columns_).subspan(whole, others_.size() - whole),
              best);
}

__attribute__((target("avx512vpopcntdq,avx512f,avx512bw"))) BestTwo DistanceRows::compute_avx512(
    const Descriptor& query) {
  __m512i q[4];
  for (std::size_t k = 0; k < 4; ++k)
    q[k] = _mm512_set1_epi64(static_cast<long long>(query.words[k]));
  __m512i first = _mm512_set1_epi16(kFar), second = first;
  const std::size_t whole = others_.size() / 32 * 32;
  for (std::size_t i = 0; i < padded_; i += 32) {
    __m512i distances = _mm512_setzero_si512();
    for (int s = 3; s >= 0; --s) {
      __m512i sums = _mm512_setzero_si512();
      for (std::size_t k = 0; k < 4; ++k) {
        const std::uint64_t* const at = &words_[k * padded_ + i + static_cast<std::size_t>(s) * 8];
        sums = _mm512_add_epi64(
            sums, _mm512_popcnt_epi64(_mm512_xor_si512(q[k], _mm512_loadu_si512(at))));
      }
      distances = _mm512_or_si512(_mm512_slli_epi64(distances, 16), sums);
    }
    _mm512_storeu_si512(&row_[i], distances);
    if (i >= whole) continue;
    _mm512_storeu_si512(&columns_[i],
                        _mm512_min_epu16(_mm512_loadu_si512(&columns_[i]), distances));
    second = _mm512_min_epu16(second, _mm512_max_epu16(first, distances));
    first = _mm512_min_epu16(first, distances);
  }
  alignas(64) std::array<std::uint16_t, 32> firsts, seconds;
  _mm512_store_si512(firsts.data(), first);
  _mm512_store_si512(seconds.data(), second);
  BestTwo best;
  for (std::size_t lane = 0; lane < firsts.size(); ++lane) {
    best.add(firsts[lane]);
    best.add(seconds[lane]);
  }
  return scan(row().subspan(whole), std::span(columns_).subspan(whole, others_.size() - whole),
              best);
}

#endif

}  // namespace loopd
