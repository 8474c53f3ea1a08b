#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "base/unique_fd.h"

namespace loopd {

/// The levels of syslog(3) that loopd uses; the numbers are what journald reads after `<`.
enum class LogLevel : std::uint8_t { kError = 3, kWarning = 4, kNotice = 5, kInfo = 6, kDebug = 7 };

/// A name and its value, printed as name=value after the message; without a value it is left out.
using LogField = std::pair<std::string_view, std::string>;

/// What kind of event an entry tells of: a 128-bit id as 32 hexadecimal digits, the MESSAGE_ID of
/// systemd's journal, the same in every version. Empty: none.
using MessageId = std::string_view;

/// Writes one line a message to a file descriptor: "message name=value name=\"two words\"", after
/// the level ("error: ", or "<3>" for journald); or one entry with fields to the journal. Only the
/// app and the tools log; libraries return errors. Whatever a message or value holds, it stays one
/// line, or one field. Thread-safe: a message is one write, and a reader that is gone or full costs
/// the message, never the caller.
class Log {
 public:
  enum class Format : std::uint8_t {
    kPlain,    ///< lines for people
    kJournal,  ///< lines with a level before them, as journald reads from a stream
    kEntries,  ///< datagrams in the journal's native protocol: each field can be searched for
  };

  Log(int fd, Format format, LogLevel most_verbose = LogLevel::kInfo)
      : fd_(fd), format_(format), most_verbose_(most_verbose) {}

  /// Standard error; the journal if that is where systemd connected it (JOURNAL_STREAM), by
  /// entries with fields if `journal_socket` answers, else by lines.
  static Log to_stderr(const std::string& journal_socket = "/run/systemd/journal/socket");

  /// A field `name` becomes LOOPD_NAME in the journal.
  void write(LogLevel level, std::string_view message, std::initializer_list<LogField> fields = {},
             MessageId id = {}) const;
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
  void send(const std::string& text) const;

  int fd_;
  Format format_;
  LogLevel most_verbose_;
  std::shared_ptr<const UniqueFd> owned_;  ///< of the journal's socket, closed with the last copy
};

}  // namespace loopd
