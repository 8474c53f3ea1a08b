#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "app/daemon_config.h"
#include "loopd/report.h"

namespace loopd::loopeval {

inline constexpr std::size_t kOutcomes = static_cast<std::size_t>(Outcome::kError) + 1;

/// The stages of a frame in the order of StageTimes; the last is their total.
inline constexpr std::array kStageNames = {"features", "search", "verify", "update", "total"};

/// What a run was, added up frame by frame. Thread: one owner.
struct Summary {
  std::string source;          ///< Camera::describe()
  std::size_t frames = 0;      ///< rows of frames.csv
  std::size_t unreadable = 0;  ///< of these
  std::array<std::size_t, kOutcomes> outcomes{};
  std::array<std::vector<std::int64_t>, kStageNames.size()> stage_ns;  ///< of each frame
  int max_points = 0;                                                  ///< in one frame
  int max_lines = 0;
  std::size_t words_points = 0;  ///< after the last frame, as the next three
  std::size_t words_lines = 0;
  std::size_t images = 0;
  std::size_t bytes = 0;
  std::int64_t wall_ns = 0;  ///< of the run, reading the images included

  void add(const Report& report);
  void add_unreadable();
  std::size_t loops() const { return outcomes[static_cast<std::size_t>(Outcome::kLoop)]; }
};

/// Mean, percentiles (nearest rank) and largest of some times, milliseconds; all 0 if there is
/// none.
struct TimeStatistics {
  double mean_ms = 0;
  double p50_ms = 0;
  double p95_ms = 0;
  double p99_ms = 0;
  double max_ms = 0;
};
TimeStatistics time_statistics(std::vector<std::int64_t> times_ns);

/// One JSON object: version, config with every key, counts, outcomes, stage times, memory.
std::string summary_json(const Summary& summary, const DaemonConfig& config);

/// The same for people, with the table of stages; some lines.
std::string summary_text(const Summary& summary);

}  // namespace loopd::loopeval
