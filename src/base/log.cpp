#include "base/log.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
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
  if (value.find_first_of(" \"=\\") == std::string_view::npos) return append_printable(line, value);
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

/// A socket connected to the journal; invalid if there is none.
UniqueFd connect_to(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) return UniqueFd();
  std::copy(path.begin(), path.end(), std::begin(address.sun_path));
  UniqueFd fd(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const auto* generic = reinterpret_cast<const sockaddr*>(&address);
  if (fd.valid() && connect(fd.get(), generic, sizeof(address)) != 0) fd.reset();
  return fd;
}

/// One field of the native protocol: NAME=value, or, for a value of several lines, NAME, a newline,
/// the length as 64-bit little-endian and the value.
void append_field(std::string& entry, std::string_view name, std::string_view value) {
  entry += name;
  if (value.find('\n') == std::string_view::npos) {
    entry += '=';
  } else {
    entry += '\n';
    for (unsigned shift = 0; shift < 64; shift += 8)
      entry += static_cast<char>(value.size() >> shift & 0xff);
  }
  entry += value;
  entry += '\n';
}

std::string upper_case(std::string_view name) {
  std::string upper(name);
  for (char& c : upper)
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  return upper;
}

/// The message and its fields as one line, without its end.
std::string line_of(std::string_view message, std::initializer_list<LogField> fields) {
  std::string line;
  append_printable(line, message);
  for (const auto& [name, value] : fields) {
    if (value.empty()) continue;
    line += ' ';
    line += name;
    line += '=';
    append_value(line, value);
  }
  return line;
}

std::string entry_of(LogLevel level, std::string_view message,
                     std::initializer_list<LogField> fields, MessageId id) {
  std::string entry;
  append_field(entry, "MESSAGE", line_of(message, fields));
  append_field(entry, "PRIORITY", std::to_string(static_cast<int>(level)));
  append_field(entry, "SYSLOG_IDENTIFIER", "loopd");
  if (!id.empty()) append_field(entry, "MESSAGE_ID", id);
  for (const auto& [name, value] : fields)
    if (!value.empty()) append_field(entry, "LOOPD_" + upper_case(name), value);
  return entry;
}

}  // namespace

Log Log::to_stderr(const std::string& journal_socket) {
  if (!is_journal(STDERR_FILENO)) return {STDERR_FILENO, Format::kPlain};
  auto socket = std::make_shared<const UniqueFd>(connect_to(journal_socket));
  if (!socket->valid()) return {STDERR_FILENO, Format::kJournal};
  Log log(socket->get(), Format::kEntries);
  log.owned_ = std::move(socket);
  return log;
}

void Log::write(LogLevel level, std::string_view message, std::initializer_list<LogField> fields,
                MessageId id) const {
  if (level > most_verbose_) return;
  if (format_ == Format::kEntries) return send(entry_of(level, message, fields, id));
  const std::string prefix = format_ == Format::kJournal
                                 ? "<" + std::to_string(static_cast<int>(level)) + ">"
                                 : std::string(plain_prefix(level));
  send(prefix + line_of(message, fields) + '\n');
}

void Log::send(const std::string& text) const {
  pollfd ready{fd_, POLLOUT, 0};  // a pipe that polls writable takes a line without blocking
  if (poll(&ready, 1, 0) == 0) return;
  [[maybe_unused]] const ssize_t written = ::write(fd_, text.data(), text.size());
}

}  // namespace loopd
