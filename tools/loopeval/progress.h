#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

namespace loopd::loopeval {

/// Tells people on standard error how far a run is: a line that is written over on a terminal, else
/// a new one every ten seconds. Thread: one owner.
class Progress {
 public:
  /// `total`: frames of the run, if that is known.
  static Progress on_stderr(std::optional<std::size_t> total);

  void show(std::size_t frames, std::size_t loops);
  /// A line that stays. The first few are printed, the rest counted and told by end().
  void note(const std::string& text);
  void end();

 private:
  Progress(bool terminal, std::optional<std::size_t> total);

  const bool terminal_;
  const std::optional<std::size_t> total_;
  const std::int64_t began_ns_;
  std::int64_t next_ns_;
  std::size_t notes_ = 0;
};

}  // namespace loopd::loopeval
