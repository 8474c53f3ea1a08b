#include "events/history.h"

#include <cassert>
#include <utility>

namespace loopd {

void History::add(Entry entry) {
  assert(entry.seq == next_);
  ++next_;
  bytes_ += cost(entry);
  entries_.push_back(std::move(entry));
  while (bytes_ > max_bytes_ || entries_.size() > max_records_) {
    bytes_ -= cost(entries_.front());
    entries_.pop_front();
  }
}

void History::clear() {
  entries_.clear();
  bytes_ = 0;
}

const History::Entry& History::at(std::uint64_t seq) const {
  assert(seq >= oldest() && seq < next_);
  return entries_[static_cast<std::size_t>(seq - oldest())];
}

}  // namespace loopd
