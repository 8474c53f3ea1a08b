#include "events/client_queue.h"

#include <cassert>
#include <utility>

namespace loopd {

RecordText shared_line(std::string text) {
  text += '\n';
  return std::make_shared<const std::string>(std::move(text));
}

bool ClientQueue::offer(const RecordText& text, std::uint64_t seq) {
  if (has_room(text->size())) {
    push(text, seq);
    return true;
  }
  if (gap_.count == 0) gap_.first_seq = seq;
  gap_.last_seq = seq;
  ++gap_.count;
  return false;
}

void ClientQueue::push(RecordText text, std::optional<std::uint64_t> seq) {
  bytes_ += text->size();
  texts_.push_back({std::move(text), seq});
}

std::size_t ClientQueue::gather(std::span<iovec> parts) const {
  std::size_t filled = 0;
  for (const Queued& queued : texts_) {
    if (filled == parts.size()) break;
    const std::size_t skip = filled == 0 ? front_sent_ : 0;
    // iovec has no const form; sending only reads.
    parts[filled++] = {const_cast<char*>(queued.text->data()) + skip, queued.text->size() - skip};
  }
  return filled;
}

void ClientQueue::replace_front(RecordText text) {
  assert(!empty() && front_sent_ == 0);
  bytes_ = bytes_ - front()->size() + text->size();
  texts_.front() = {std::move(text), std::nullopt};
}

std::optional<Gap> ClientQueue::consume(std::size_t sent) {
  assert(sent <= bytes_);
  bytes_ -= sent;
  front_sent_ += sent;
  while (!texts_.empty() && front_sent_ >= front()->size()) {
    front_sent_ -= front()->size();
    texts_.pop_front();
  }
  return may_tell_gap() ? take_gap() : std::nullopt;
}

std::optional<Gap> ClientQueue::take_gap() {
  if (gap_.count == 0) return std::nullopt;
  return std::exchange(gap_, Gap());
}

}  // namespace loopd
