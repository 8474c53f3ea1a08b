#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "loopd/config.h"
#include "loopd/features.h"
#include "loopd/report.h"

namespace loopd {

/// An incremental vocabulary of binary words with its inverted file: one for points, one for lines
/// (DESIGN section 3, step 2, and section 4). Flat arrays only. Deterministic.
/// Thread: one caller at a time (a search uses scratch memory of its own).
class Vocabulary {
 public:
  explicit Vocabulary(const IndexConfig& config);
  ~Vocabulary();
  Vocabulary(Vocabulary&&) noexcept;

  /// Every added image that shares a word with `query`, with its score: the sum over the query's
  /// matched words of tf (n_wi / n_i) times idf (log(N / n_w)). Best first, ties by lower id.
  /// Inserts nothing. `candidates` is cleared first and keeps its capacity.
  void search(std::span<const Descriptor> query, std::vector<Candidate>& candidates);

  /// Makes `image` searchable: each descriptor joins the word it matches or becomes a new word.
  /// Ids must grow from call to call. Also deletes words whose probation ended with one image.
  /// Strong guarantee: an exception leaves the vocabulary as it was.
  void add(ImageId image, std::span<const Descriptor> descriptors);

  std::size_t words() const;
  std::size_t images() const;
  std::size_t bytes() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace loopd
