#pragma once

#include <cstdint>
#include <string>

#include "app/pipeline.h"
#include "events/records.h"

namespace loopd {

/// Makes the stats records: counters since the start, means since the record before.
/// Thread: one owner.
class StatsMeter {
 public:
  explicit StatsMeter(std::int64_t now_ns) : started_ns_(now_ns), before_ns_(now_ns) {}

  StatsRecord record(const Pipeline& pipeline, std::int64_t now_ns);

 private:
  const std::int64_t started_ns_;
  std::int64_t before_ns_;
  DetectTotals before_;
};

/// One line for `systemctl status`.
std::string status_text(const StatsRecord& record, std::size_t clients);

}  // namespace loopd
