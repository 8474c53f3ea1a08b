#include "base/log.h"

#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>

namespace loopd {
namespace {

std::string_view plain_prefix(LogLevel level) {
  switch (level) {
    case LogLevel::kError:
      return "error: ";
    case LogLevel::kWarning:
      return "warning: ";
    case LogLevel::kNotice:
    case LogLevel::kInfo:
      return "";
    case LogLevel::kDebug:
      return "debug: ";
  }
  return "";
}

/// Control characters (a file name may hold a newline) as \xNN.
void append_printable(std::string& line, std::string_view text) {
  constexpr std::string_view kHex = "0123456789abcdef";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && byte != 0x7f) {
      line += c;
    } else {
      line += "\\x";
      line += kHex[byte >> 4];
      line += kHex[byte & 0xf];
    }
  }
}

void append_value(std::string& line, std::string_view value) {
  const bool plain = !value.empty() && value.find_first_of(" \"=\\") == std::string_view::npos;
  if (plain) return append_printable(line, value);
  line += '"';
  for (const char c : value) {
    if (c == '"' || c == '\\') line += '\\';
    append_printable(line, {&c, 1});
  }
  line += '"';
}

/// systemd sets JOURNAL_STREAM to the "device:inode" of the stream it connected; a redirected
/// standard error no longer matches it (systemd.exec(5)).
bool is_journal(int fd) {
  const char* const stream = std::getenv("JOURNAL_STREAM");  // NOLINT(concurrency-mt-unsafe)
  struct stat status {};
  if (stream == nullptr || fstat(fd, &status) != 0) return false;
  return std::string(stream) == std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino);
}

}  // namespace

Log Log::to_stderr() {
  return {STDERR_FILENO, is_journal(STDERR_FILENO) ? Format::kJournal : Format::kPlain};
}

void Log::write(LogLevel level, std::string_view message,
                std::initializer_list<LogField> fields) const {
  if (level > most_verbose_) return;
  std::string line;
  if (format_ == Format::kJournal)
    line.append("<").append(std::to_string(static_cast<int>(level))).append(">");
  else
    line += plain_prefix(level);
  append_printable(line, message);
  for (const auto& [name, value] : fields) {
    line += ' ';
    line += name;
    line += '=';
    append_value(line, value);
  }
  line += '\n';
  pollfd ready{fd_, POLLOUT, 0};  // a pipe that polls writable takes a line without blocking
  if (poll(&ready, 1, 0) == 0) return;
  [[maybe_unused]] const ssize_t written = ::write(fd_, line.data(), line.size());
}

}  // namespace loopd
