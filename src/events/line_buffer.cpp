#include "events/line_buffer.h"

namespace loopd {

void LineBuffer::append(std::string_view bytes) { buffer_.append(bytes); }

LineBuffer::Next LineBuffer::next(std::string& line) {
  const std::size_t newline = buffer_.find('\n', scanned_);
  if (newline == std::string::npos) return without_newline();
  const bool end_of_discarded = discarding_;
  discarding_ = false;
  if (!end_of_discarded) return with_newline(newline, line);
  buffer_.erase(0, newline + 1);
  scanned_ = 0;
  return next(line);  // once at most: discarding_ is false now
}

LineBuffer::Next LineBuffer::without_newline() {
  scanned_ = buffer_.size();
  if (!discarding_ && buffer_.size() <= max_line_bytes_) return Next::kNone;
  const bool first_time = !discarding_;
  discarded_bytes_ = (first_time ? 0 : discarded_bytes_) + buffer_.size();
  discarding_ = true;
  buffer_.clear();
  scanned_ = 0;
  return first_time ? Next::kTooLong : Next::kNone;
}

LineBuffer::Next LineBuffer::with_newline(std::size_t newline, std::string& line) {
  const bool fits = newline <= max_line_bytes_;
  if (fits) line.assign(buffer_, 0, newline);
  buffer_.erase(0, newline + 1);
  scanned_ = 0;
  return fits ? Next::kLine : Next::kTooLong;
}

}  // namespace loopd
