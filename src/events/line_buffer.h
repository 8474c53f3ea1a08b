#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace loopd {

/// Cuts a byte stream into lines and never holds more than one line of the longest allowed length
/// plus what the last append() brought. Thread: one owner at a time.
class LineBuffer {
 public:
  enum class Next {
    kNone,     ///< no complete line yet
    kLine,     ///< `line` holds one, without its newline
    kTooLong,  ///< a line was longer than allowed; told once, the rest of it is thrown away
  };

  explicit LineBuffer(std::size_t max_line_bytes) : max_line_bytes_(max_line_bytes) {}

  void append(std::string_view bytes);
  Next next(std::string& line);
  /// Whether a line has begun and its newline has not come.
  bool has_partial_line() const { return discarding_ || !buffer_.empty(); }
  /// Bytes thrown away of the too long line that is passing now; 0 if none is.
  std::size_t discarded_bytes() const { return discarding_ ? discarded_bytes_ : 0; }
  std::size_t held_bytes() const { return buffer_.size(); }

 private:
  Next without_newline();
  Next with_newline(std::size_t newline, std::string& line);

  std::size_t max_line_bytes_;
  std::string buffer_;
  std::size_t scanned_ = 0;  ///< no newline before this position
  bool discarding_ = false;
  std::size_t discarded_bytes_ = 0;
};

}  // namespace loopd
