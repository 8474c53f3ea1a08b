#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

#include "events/client_queue.h"
#include "events/records.h"

namespace loopd {

/// The newest published records, for clients that were away, bounded in bytes and in number; the
/// oldest go first. Holds the form without pairs only: the long form is made only while somebody
/// asks for it, and fifteen of them would fill the default history.
/// Thread: one owner at a time.
class History {
 public:
  struct Entry {
    std::uint64_t seq;
    RecordClass record_class;
    RecordText text;
  };
  /// What an entry costs beside its text.
  static constexpr std::size_t kEntryBytes = sizeof(Entry) + 64;

  History(std::size_t max_bytes, std::size_t max_records)
      : max_bytes_(max_bytes), max_records_(max_records) {}

  /// Precondition: entry.seq follows the one before by 1. One that is larger than the history
  /// leaves it empty.
  void add(Entry entry);
  void clear();

  /// The seq of the oldest record held; newest + 1 if there is none.
  std::uint64_t oldest() const { return next_ - entries_.size(); }
  /// The record `seq`. Precondition: oldest() <= seq <= newest.
  const Entry& at(std::uint64_t seq) const;
  std::size_t bytes() const { return bytes_; }

 private:
  static std::size_t cost(const Entry& entry) { return entry.text->size() + kEntryBytes; }

  std::size_t max_bytes_;
  std::size_t max_records_;
  std::deque<Entry> entries_;
  std::size_t bytes_ = 0;
  std::uint64_t next_ = 1;  ///< the seq that comes next
};

}  // namespace loopd
