#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace loopd::eval {

/// Reads a comma-separated table with a header line, a row at a time. Fields may be quoted (RFC
/// 4180, but no line break inside a field); CRLF line ends, a byte-order mark and blank lines are
/// accepted. Every error names file, line and, where there is one, column.
/// Cost: memory of one line (at most kMaxLineBytes). Thread: one at a time.
class CsvReader {
 public:
  static constexpr std::size_t kMaxLineBytes = 1 << 16;

  /// Errors: cannot be read, empty, header with an empty or a repeated name.
  static Result<CsvReader> open(const std::filesystem::path& path);

  /// Index of the column called `name`; error if there is none.
  Result<std::size_t> column(std::string_view name) const;

  /// Moves to the next row; false at the end. Errors: a row that has not as many fields as the
  /// header, a broken quote, a line too long, a read error.
  Result<bool> next();

  std::size_t line() const { return line_; }
  /// Field of the current row. Valid until next().
  std::string_view text(std::size_t column) const { return fields_[column]; }
  /// Errors: not a whole number in [lo, hi].
  Result<std::int64_t> integer(std::size_t column, std::int64_t lo, std::int64_t hi) const;
  /// Errors: not a finite number.
  Result<double> real(std::size_t column) const;
  /// "FILE:LINE: column NAME: WHAT" about the current row.
  Error error_at(std::size_t column, const std::string& what) const;

 private:
  explicit CsvReader(const std::filesystem::path& path) : path_(path.string()) {}
  Result<bool> read_line();
  Status split();
  Error error_here(const std::string& what) const;

  std::string path_;
  std::ifstream in_;
  std::size_t line_ = 0;
  std::string buffer_;
  std::vector<std::string> names_;
  std::vector<std::string> fields_;
  std::size_t count_ = 0;  ///< fields of the current row
};

}  // namespace loopd::eval
