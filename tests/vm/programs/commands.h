#pragma once

#include <optional>
#include <string>
#include <vector>

namespace loopd::vm {

/// Lines of words that come in over a descriptor which is polled elsewhere.
/// Thread: one caller at a time.
class CommandReader {
 public:
  explicit CommandReader(int fd) : fd_(fd) {}

  /// Reads what is there; call it when the descriptor is readable. False: the writer has gone.
  bool fill();
  /// The words of the next whole line; none if there is no whole line yet.
  std::optional<std::vector<std::string>> next();

 private:
  const int fd_;
  std::string text_;
};

}  // namespace loopd::vm
