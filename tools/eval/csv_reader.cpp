#include "eval/csv_reader.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>

namespace loopd::eval {
namespace {

/// Text of a hostile file, fit for one line of an error message.
std::string shown_text(std::string_view text) {
  constexpr std::size_t kShown = 40;
  std::string out = "\"";
  for (const char c : text.substr(0, kShown)) out += c >= ' ' && c <= '~' ? c : '?';
  return out + (text.size() > kShown ? "...\"" : "\"");
}

template <class T>
bool parse(std::string_view text, T& value) {
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  return error == std::errc{} && stop == end;
}

}  // namespace

Error CsvReader::error_here(const std::string& what) const {
  return Error{path_ + ":" + std::to_string(line_) + ": " + what, 0};
}

Error CsvReader::error_at(std::size_t column, const std::string& what) const {
  return error_here("column " + names_[column] + ": " + what);
}

Result<CsvReader> CsvReader::open(const std::filesystem::path& path) {
  CsvReader reader(path);
  std::error_code code;
  if (std::filesystem::is_directory(path, code)) {
    return Error{"cannot read " + path.string() + ": it is a folder", EISDIR};
  }
  errno = 0;
  reader.in_.open(path, std::ios::binary);
  if (!reader.in_) return errno_error("cannot open " + path.string(), errno != 0 ? errno : EIO);
  const auto some = reader.next();
  if (!some) return some.error();
  if (!some.value()) return Error{path.string() + " is empty: a header line is needed", 0};
  std::vector<std::string> names(
      reader.fields_.begin(), reader.fields_.begin() + static_cast<std::ptrdiff_t>(reader.count_));
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto self = names.begin() + static_cast<std::ptrdiff_t>(i);
    if (names[i].empty()) {
      return reader.error_here("column " + std::to_string(i + 1) + " of the header has no name");
    }
    if (std::find(names.begin(), self, names[i]) != self) {
      return reader.error_here("column " + shown_text(names[i]) + " is in the header twice");
    }
  }
  reader.names_ = std::move(names);
  return reader;
}

Result<std::size_t> CsvReader::column(std::string_view name) const {
  const auto found = std::find(names_.begin(), names_.end(), name);
  if (found != names_.end()) return static_cast<std::size_t>(found - names_.begin());
  std::string have;
  for (const std::string& other : names_) have += (have.empty() ? "" : ", ") + other;
  return Error{path_ + ":1: there is no column " + shown_text(name) + "; the columns are " +
                   shown_text(have),
               0};
}

/// The next line that is not blank into the buffer; false at the end of the file.
Result<bool> CsvReader::read_line() {
  constexpr int kEnd = std::char_traits<char>::eof();
  std::filebuf& file = *in_.rdbuf();
  while (true) {
    buffer_.clear();
    ++line_;
    int c = file.sbumpc();
    if (c == kEnd) return false;
    for (; c != kEnd && c != '\n'; c = file.sbumpc()) {
      if (buffer_.size() == kMaxLineBytes) {
        return error_here("the line is longer than " + std::to_string(kMaxLineBytes) + " bytes");
      }
      buffer_ += static_cast<char>(c);
    }
    if (line_ == 1 && buffer_.starts_with("\xef\xbb\xbf")) buffer_.erase(0, 3);
    if (!buffer_.empty() && buffer_.back() == '\r') buffer_.pop_back();
    if (!buffer_.empty()) return true;
  }
}

/// Cuts the buffer into fields, reusing their memory.
Status CsvReader::split() {
  count_ = 0;
  std::size_t at = 0;
  while (true) {
    if (count_ == fields_.size()) fields_.emplace_back();
    std::string& field = fields_[count_++];
    field.clear();
    if (at < buffer_.size() && buffer_[at] == '"') {
      for (++at;; ++at) {
        if (at >= buffer_.size()) return error_here("a quoted field does not end");
        if (buffer_[at] != '"') {
          field += buffer_[at];
        } else if (at + 1 < buffer_.size() && buffer_[at + 1] == '"') {
          field += buffer_[++at];
        } else {
          break;
        }
      }
      ++at;
      if (at < buffer_.size() && buffer_[at] != ',') {
        return error_here("text follows the end of a quoted field");
      }
    } else {
      const std::size_t end = std::min(buffer_.find(',', at), buffer_.size());
      field.assign(buffer_, at, end - at);
      at = end;
    }
    if (at >= buffer_.size()) return Nothing{};
    ++at;  // the comma
  }
}

Result<bool> CsvReader::next() {
  try {  // the stream's buffer reports a failing disk by throwing
    const auto some = read_line();
    if (!some) return some.error();
    if (!some.value()) return false;
  } catch (const std::ios_base::failure& failure) {
    return error_here(std::string("cannot read on: ") + failure.what());
  }
  if (const Status cut = split(); !cut) return cut.error();
  if (!names_.empty() && count_ != names_.size()) {
    return error_here("the row has " + std::to_string(count_) + " fields, the header has " +
                      std::to_string(names_.size()));
  }
  return true;
}

Result<std::int64_t> CsvReader::integer(std::size_t column, std::int64_t lo,
                                        std::int64_t hi) const {
  std::int64_t value = 0;
  if (!parse(text(column), value) || value < lo || value > hi) {
    return error_at(column, shown_text(text(column)) + " is not a whole number from " +
                                std::to_string(lo) + " to " + std::to_string(hi));
  }
  return value;
}

Result<double> CsvReader::real(std::size_t column) const {
  double value = 0;
  if (!parse(text(column), value) || !std::isfinite(value)) {
    return error_at(column, shown_text(text(column)) + " is not a finite number");
  }
  return value;
}

}  // namespace loopd::eval
