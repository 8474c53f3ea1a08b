#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "loopd/features.h"

namespace loopd {

/// Number of differing bits of two descriptors, [0, 256]. Portable; for single comparisons.
int hamming_distance(const Descriptor& a, const Descriptor& b);

/// The implementations of the batch functions below that this CPU can run, portable first. All give
/// the same results; the last is the fastest and is the one used.
enum class HammingForm : std::uint8_t { kPortable, kPopcnt, kAvx2, kAvx512, kNeon };
std::span<const HammingForm> hamming_forms();
std::string_view hamming_form_name(HammingForm form);

/// distances[i] = hamming(query, others[i]). Sizes of `others` and `distances` are equal.
void hamming_distances(const Descriptor& query, std::span<const Descriptor> others,
                       std::span<std::uint16_t> distances);
void hamming_distances(HammingForm form, const Descriptor& query,
                       std::span<const Descriptor> others, std::span<std::uint16_t> distances);

/// distances[i] = hamming(query, table[ids[i]]), prefetching ahead. Sizes of `ids` and `distances`
/// are equal; every id is below the length of `table`.
void hamming_distances_at(const Descriptor& query, const Descriptor* table,
                          std::span<const std::uint32_t> ids, std::span<std::uint16_t> distances);
void hamming_distances_at(HammingForm form, const Descriptor& query, const Descriptor* table,
                          std::span<const std::uint32_t> ids, std::span<std::uint16_t> distances);

}  // namespace loopd
