#include "base/hamming.h"

#include <array>
#include <cassert>

#if defined(__x86_64__)
// g++ 12 takes the deliberately undefined operands inside these intrinsics for mistakes (bug
// 105593).
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

namespace loopd {
namespace {

constexpr std::size_t kPrefetchAhead = 8;

using Batch = void (*)(const Descriptor&, const Descriptor*, std::size_t, std::uint16_t*);
using Gather = void (*)(const Descriptor&, const Descriptor*, const std::uint32_t*, std::size_t,
                        std::uint16_t*);

// Bit counts without an instruction for it: pairs, nibbles, bytes, then one multiplication.
inline unsigned popcount_portable(std::uint64_t v) {
  v -= (v >> 1) & 0x5555555555555555u;
  v = (v & 0x3333333333333333u) + ((v >> 2) & 0x3333333333333333u);
  v = (v + (v >> 4)) & 0x0f0f0f0f0f0f0f0fu;
  return static_cast<unsigned>((v * 0x0101010101010101u) >> 56);
}

inline std::uint16_t distance_portable(const Descriptor& a, const Descriptor& b) {
  unsigned sum = 0;
  for (std::size_t i = 0; i < 4; ++i) sum += popcount_portable(a.words[i] ^ b.words[i]);
  return static_cast<std::uint16_t>(sum);
}

// One body for every form: `Distance` is inlined into a function compiled for its instruction set.
#define LOOPD_HAMMING_FORM(suffix, target, distance)                                           \
  target void batch_##suffix(const Descriptor& query, const Descriptor* others, std::size_t n, \
                             std::uint16_t* out) {                                             \
    for (std::size_t i = 0; i < n; ++i) out[i] = distance(query, others[i]);                   \
  }                                                                                            \
  target void gather_##suffix(const Descriptor& query, const Descriptor* table,                \
                              const std::uint32_t* ids, std::size_t n, std::uint16_t* out) {   \
    for (std::size_t i = 0; i < n; ++i) {                                                      \
      if (i + kPrefetchAhead < n) __builtin_prefetch(table + ids[i + kPrefetchAhead]);         \
      out[i] = distance(query, table[ids[i]]);                                                 \
    }                                                                                          \
  }

LOOPD_HAMMING_FORM(portable, , distance_portable)

#if defined(__x86_64__)

#define LOOPD_POPCNT __attribute__((target("popcnt")))
LOOPD_POPCNT inline std::uint16_t distance_popcnt(const Descriptor& a, const Descriptor& b) {
  long long sum = 0;
  for (std::size_t i = 0; i < 4; ++i) sum += _mm_popcnt_u64(a.words[i] ^ b.words[i]);
  return static_cast<std::uint16_t>(sum);
}
LOOPD_HAMMING_FORM(popcnt, LOOPD_POPCNT, distance_popcnt)

// Bit counts of nibbles by a table of 16 (Mula, Kurz, Lemire 2018), of all 256 bits at once.
#define LOOPD_AVX2 __attribute__((target("avx2")))
LOOPD_AVX2 inline __m256i byte_counts(__m256i v) {
  const __m256i of_nibble =
      _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4));
  const __m256i low = _mm256_set1_epi8(0x0f);
  return _mm256_add_epi8(
      _mm256_shuffle_epi8(of_nibble, _mm256_and_si256(v, low)),
      _mm256_shuffle_epi8(of_nibble, _mm256_and_si256(_mm256_srli_epi16(v, 4), low)));
}

LOOPD_AVX2 inline std::uint16_t distance_avx2(const Descriptor& a, const Descriptor& b) {
  const __m256i x = _mm256_load_si256(reinterpret_cast<const __m256i*>(a.words.data()));
  const __m256i y = _mm256_load_si256(reinterpret_cast<const __m256i*>(b.words.data()));
  const __m256i sums = _mm256_sad_epu8(byte_counts(_mm256_xor_si256(x, y)), _mm256_setzero_si256());
  const __m128i half =
      _mm_add_epi64(_mm256_castsi256_si128(sums), _mm256_extracti128_si256(sums, 1));
  return static_cast<std::uint16_t>(_mm_cvtsi128_si32(half) + _mm_extract_epi16(half, 4));
}
LOOPD_HAMMING_FORM(avx2, LOOPD_AVX2, distance_avx2)

#define LOOPD_AVX512 __attribute__((target("avx512vpopcntdq,avx512f,avx512vl,avx2")))
LOOPD_AVX512 inline std::uint16_t distance_avx512(const Descriptor& a, const Descriptor& b) {
  const __m256i x = _mm256_load_si256(reinterpret_cast<const __m256i*>(a.words.data()));
  const __m256i y = _mm256_load_si256(reinterpret_cast<const __m256i*>(b.words.data()));
  const __m256i counts = _mm256_popcnt_epi64(_mm256_xor_si256(x, y));
  const __m128i half =
      _mm_add_epi64(_mm256_castsi256_si128(counts), _mm256_extracti128_si256(counts, 1));
  return static_cast<std::uint16_t>(_mm_cvtsi128_si64(half) + _mm_extract_epi64(half, 1));
}
LOOPD_HAMMING_FORM(avx512_single, LOOPD_AVX512, distance_avx512)

LOOPD_AVX512 inline __m512i bit_counts(__m512i query, const Descriptor* pair) {
  return _mm512_popcnt_epi64(_mm512_xor_si512(query, _mm512_loadu_si512(pair)));
}

// Eight descriptors at a time: two a register, whose word counts are summed across by shuffles, so
// that no sum leaves the vector unit: 2.4 times as fast as one by one.
LOOPD_AVX512 void batch_avx512(const Descriptor& query, const Descriptor* others, std::size_t n,
                               std::uint16_t* out) {
  const __m512i q = _mm512_broadcast_i64x4(
      _mm256_load_si256(reinterpret_cast<const __m256i*>(query.words.data())));
  const __m512i order = _mm512_setr_epi64(0, 2, 1, 3, 4, 6, 5, 7);
  std::size_t i = 0;
  for (; i + 8 <= n; i += 8) {
    const __m512i ab = bit_counts(q, others + i);
    const __m512i cd = bit_counts(q, others + i + 2);
    const __m512i ef = bit_counts(q, others + i + 4);
    const __m512i gh = bit_counts(q, others + i + 6);
    // Lanes of 128 bits: (a01 c01) (a23 c23) (b01 d01) (b23 d23), and the same for e..h.
    const __m512i acbd =
        _mm512_add_epi64(_mm512_unpacklo_epi64(ab, cd), _mm512_unpackhi_epi64(ab, cd));
    const __m512i egfh =
        _mm512_add_epi64(_mm512_unpacklo_epi64(ef, gh), _mm512_unpackhi_epi64(ef, gh));
    const __m512i sums = _mm512_add_epi64(_mm512_shuffle_i64x2(acbd, egfh, 0x88),
                                          _mm512_shuffle_i64x2(acbd, egfh, 0xdd));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(out + i),
                     _mm512_cvtepi64_epi16(_mm512_permutexvar_epi64(order, sums)));
  }
  batch_avx512_single(query, others + i, n - i, out + i);
}

#elif defined(__aarch64__)

inline std::uint16_t distance_neon(const Descriptor& a, const Descriptor& b) {
  const auto* x = reinterpret_cast<const std::uint8_t*>(a.words.data());
  const auto* y = reinterpret_cast<const std::uint8_t*>(b.words.data());
  const uint8x16_t low = vcntq_u8(veorq_u8(vld1q_u8(x), vld1q_u8(y)));
  const uint8x16_t high = vcntq_u8(veorq_u8(vld1q_u8(x + 16), vld1q_u8(y + 16)));
  return vaddlvq_u8(vaddq_u8(low, high));
}
LOOPD_HAMMING_FORM(neon, , distance_neon)

#endif

struct Forms {
  std::array<HammingForm, 4> list{};
  std::size_t count = 0;

  Forms() {
    list[count++] = HammingForm::kPortable;
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("popcnt")) list[count++] = HammingForm::kPopcnt;
    if (__builtin_cpu_supports("avx2")) list[count++] = HammingForm::kAvx2;
    if (__builtin_cpu_supports("avx512vpopcntdq") && __builtin_cpu_supports("avx512f") &&
        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx2"))
      list[count++] = HammingForm::kAvx512;
#elif defined(__aarch64__)
    list[count++] = HammingForm::kNeon;
#endif
  }
};

const Forms& forms() {
  static const Forms instance;
  return instance;
}

Batch batch_of(HammingForm form) {
  switch (form) {
#if defined(__x86_64__)
    case HammingForm::kPopcnt:
      return batch_popcnt;
    case HammingForm::kAvx2:
      return batch_avx2;
    case HammingForm::kAvx512:
      return batch_avx512;
#elif defined(__aarch64__)
    case HammingForm::kNeon:
      return batch_neon;
#endif
    default:
      return batch_portable;
  }
}

Gather gather_of(HammingForm form) {
  switch (form) {
#if defined(__x86_64__)
    case HammingForm::kPopcnt:
      return gather_popcnt;
    case HammingForm::kAvx2:
      return gather_avx2;
    case HammingForm::kAvx512:
      return gather_avx512_single;
#elif defined(__aarch64__)
    case HammingForm::kNeon:
      return gather_neon;
#endif
    default:
      return gather_portable;
  }
}

HammingForm fastest() { return hamming_forms().back(); }

}  // namespace

int hamming_distance(const Descriptor& a, const Descriptor& b) { return distance_portable(a, b); }

std::span<const HammingForm> hamming_forms() { return {forms().list.data(), forms().count}; }

std::string_view hamming_form_name(HammingForm form) {
  switch (form) {
    case HammingForm::kPortable:
      return "portable";
    case HammingForm::kPopcnt:
      return "popcnt";
    case HammingForm::kAvx2:
      return "avx2";
    case HammingForm::kAvx512:
      return "avx512";
    case HammingForm::kNeon:
      return "neon";
  }
  return "unknown";
}

void hamming_distances(HammingForm form, const Descriptor& query,
                       std::span<const Descriptor> others, std::span<std::uint16_t> distances) {
  assert(others.size() == distances.size());
  batch_of(form)(query, others.data(), others.size(), distances.data());
}

void hamming_distances(const Descriptor& query, std::span<const Descriptor> others,
                       std::span<std::uint16_t> distances) {
  static const Batch batch = batch_of(fastest());
  assert(others.size() == distances.size());
  batch(query, others.data(), others.size(), distances.data());
}

void hamming_distances_at(HammingForm form, const Descriptor& query, const Descriptor* table,
                          std::span<const std::uint32_t> ids, std::span<std::uint16_t> distances) {
  assert(ids.size() == distances.size());
  gather_of(form)(query, table, ids.data(), ids.size(), distances.data());
}

void hamming_distances_at(const Descriptor& query, const Descriptor* table,
                          std::span<const std::uint32_t> ids, std::span<std::uint16_t> distances) {
  static const Gather gather = gather_of(fastest());
  assert(ids.size() == distances.size());
  gather(query, table, ids.data(), ids.size(), distances.data());
}

}  // namespace loopd
