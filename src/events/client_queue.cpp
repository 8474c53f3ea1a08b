#include "events/client_queue.h"

#include <cassert>
#include <utility>

namespace loopd {

bool ClientQueue::offer(const RecordText& text, std::uint64_t seq) {
  const bool fits = empty() || bytes_ + text->size() <= max_bytes_;
  if (gap_.count == 0 && fits) {
    push(text);
    return true;
  }
  if (gap_.count == 0) gap_.first_seq = seq;
  gap_.last_seq = seq;
  ++gap_.count;
  return false;
}

void ClientQueue::push(RecordText text) {
  bytes_ += text->size();
  texts_.push_back(std::move(text));
}

std::size_t ClientQueue::gather(std::span<iovec> parts) const {
  std::size_t filled = 0;
  for (const RecordText& text : texts_) {
    if (filled == parts.size()) break;
    const std::size_t skip = filled == 0 ? front_sent_ : 0;
    // iovec has no const form; sending only reads.
    parts[filled++] = {const_cast<char*>(text->data()) + skip, text->size() - skip};
  }
  return filled;
}

std::optional<Gap> ClientQueue::consume(std::size_t sent) {
  assert(sent <= bytes_);
  bytes_ -= sent;
  front_sent_ += sent;
  while (!texts_.empty() && front_sent_ >= texts_.front()->size()) {
    front_sent_ -= texts_.front()->size();
    texts_.pop_front();
  }
  // Only at half: a client that reads slowly gets long unbroken runs, not a gap per record.
  if (gap_.count == 0 || bytes_ > max_bytes_ / 2) return std::nullopt;
  return std::exchange(gap_, Gap());
}

}  // namespace loopd
