#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <span>

// Loops over bytes that must be fast are written once, as templates over a vector type of the
// compiler's (16 bytes: every x86-64 and ARM64; 32: AVX2), and compiled for each form: always
// inlined into a function of the form's instruction set. All forms compute the same integers.

namespace loopd {

enum class SimdForm { kBaseline, kAvx2 };

/// The forms this CPU can run, the fastest last. Thread-safe.
std::span<const SimdForm> simd_forms();
inline SimdForm fastest_simd_form() { return simd_forms().back(); }

#define LOOPD_INLINE [[gnu::always_inline]] inline
#if defined(__x86_64__)
#define LOOPD_AVX2 __attribute__((target("avx2")))
#endif

namespace simd {

using Bytes16 = std::uint8_t __attribute__((vector_size(16)));
using Bytes32 = std::uint8_t __attribute__((vector_size(32)));

template <class V>
LOOPD_INLINE V load(const std::uint8_t* from) {
  V v;
  std::memcpy(&v, from, sizeof(V));
  return v;
}

template <class V>
LOOPD_INLINE void store(std::uint8_t* to, V v) {
  std::memcpy(to, &v, sizeof(V));
}

template <class V>
LOOPD_INLINE V all(std::uint8_t value) {
  V v;
  std::memset(&v, value, sizeof(V));
  return v;
}

template <class V>
LOOPD_INLINE V min(V a, V b) {
  return a < b ? a : b;
}

template <class V>
LOOPD_INLINE V max(V a, V b) {
  return a > b ? a : b;
}

/// a - b, not below 0.
template <class V>
LOOPD_INLINE V minus(V a, V b) {
  return max(a, b) - b;
}

template <class V>
LOOPD_INLINE bool any(V v) {
  std::array<std::uint64_t, sizeof(V) / 8> words;
  std::memcpy(words.data(), &v, sizeof(V));
  std::uint64_t bits = 0;
  for (const std::uint64_t word : words) bits |= word;
  return bits != 0;
}

}  // namespace simd
}  // namespace loopd
