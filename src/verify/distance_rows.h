#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "loopd/features.h"

namespace loopd {

/// Ways to compute rows of distances; all give the same. kGeneric runs everywhere.
enum class RowForm : std::uint8_t { kGeneric, kAvx2, kAvx512 };

/// Those this CPU has, the fastest last.
std::span<const RowForm> row_forms();

/// Distances of one descriptor after the other to all of a set, a row at a time, with what matching
/// wants to know of them. Holds the set in an order that suits the CPU's vectors; memory is kept
/// from set to set. Thread: one caller at a time.
class DistanceRows {
 public:
  /// Distances are below; stands for "there is none".
  static constexpr std::uint16_t kFar = 0x7fff;

  /// The two smallest distances of a row, the second kFar if there is but one.
  struct BestTwo {
    std::uint16_t first = kFar;
    std::uint16_t second = kFar;
    friend bool operator==(const BestTwo&, const BestTwo&) = default;

    void add(std::uint16_t distance) {
      const std::uint16_t larger = first > distance ? first : distance;
      if (larger < second) second = larger;
      if (distance < first) first = distance;
    }
  };

  explicit DistanceRows(RowForm form = row_forms().back()) : form_(form) {}

  /// Takes the set, whose descriptors must live as long as rows are asked for. Column minima are
  /// kFar again.
  void assign(std::span<const Descriptor> others);

  /// Computes the row of `query`: row()[i] is its distance to the i-th of the set, and
  /// column_best()[i] the smallest in that column of all rows since assign().
  BestTwo compute(const Descriptor& query);

  std::span<const std::uint16_t> row() const { return {row_.data(), others_.size()}; }
  std::span<const std::uint16_t> column_best() const { return {columns_.data(), others_.size()}; }

 private:
  BestTwo compute_generic(const Descriptor& query);
#if defined(__x86_64__)
  void transpose(std::size_t lanes);
  BestTwo compute_avx2(const Descriptor& query);
  BestTwo compute_avx512(const Descriptor& query);
#endif

  RowForm form_;
  std::span<const Descriptor> others_;
  std::size_t padded_ = 0;            // multiple of a block of 4 vectors
  std::vector<std::uint64_t> words_;  // word 0 of all, word 1 of all, ...; blocks in vector order
  std::vector<std::uint16_t> row_;
  std::vector<std::uint16_t> columns_;
};

}  // namespace loopd
