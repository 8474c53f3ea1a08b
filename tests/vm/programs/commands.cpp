#include "commands.h"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <iterator>
#include <sstream>

namespace loopd::vm {

bool CommandReader::fill() {
  std::array<char, 4096> bytes{};
  const ssize_t n = read(fd_, bytes.data(), bytes.size());
  if (n < 0) return errno == EINTR || errno == EAGAIN;
  text_.append(bytes.data(), static_cast<std::size_t>(n));
  return n > 0;
}

std::optional<std::vector<std::string>> CommandReader::next() {
  const std::size_t end = text_.find('\n');
  if (end == std::string::npos) return std::nullopt;
  std::istringstream line(text_.substr(0, end));
  text_.erase(0, end + 1);
  return std::vector<std::string>(std::istream_iterator<std::string>(line), {});
}

}  // namespace loopd::vm
