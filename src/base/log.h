#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

namespace loopd {

/// The levels of syslog(3) that loopd uses; the numbers are what journald reads after `<`.
enum class LogLevel : std::uint8_t { kError = 3, kWarning = 4, kNotice = 5, kInfo = 6, kDebug = 7 };

/// A name and its value, printed as name=value after the message.
using LogField = std::pair<std::string_view, std::string>;

/// Writes one line a message to a file descriptor: "message name=value name=\"two words\"", after
/// the level ("error: ", or "<3>" for journald). Only the app and the tools log; libraries return
/// errors. Whatever a message or value holds, it stays one line. Thread-safe: a line is one write,
/// and a reader that is gone or full costs the line, never the caller.
class Log {
 public:
  enum class Format : std::uint8_t { kPlain, kJournal };

  Log(int fd, Format format, LogLevel most_verbose = LogLevel::kInfo)
      : fd_(fd), format_(format), most_verbose_(most_verbose) {}

  /// Standard error; for journald if that is where systemd connected it (JOURNAL_STREAM).
  static Log to_stderr();

  void write(LogLevel level, std::string_view message,
             std::initializer_list<LogField> fields = {}) const;
  void error(std::string_view message, std::initializer_list<LogField> fields = {}) const {
    write(LogLevel::kError, message, fields);
  }
  void warning(std::string_view message, std::initializer_list<LogField> fields = {}) const {
    write(LogLevel::kWarning, message, fields);
  }
  void notice(std::string_view message, std::initializer_list<LogField> fields = {}) const {
    write(LogLevel::kNotice, message, fields);
  }
  void info(std::string_view message, std::initializer_list<LogField> fields = {}) const {
    write(LogLevel::kInfo, message, fields);
  }

 private:
  int fd_;
  Format format_;
  LogLevel most_verbose_;
};

}  // namespace loopd
