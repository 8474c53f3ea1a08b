#include "app/stats_meter.h"

#include <cmath>

namespace loopd {
namespace {

/// Times per frame of the frames between two totals. Precondition: there is one.
StageTimes means(const DetectTotals& before, const DetectTotals& now) {
  const auto frames = static_cast<std::int64_t>(now.frames - before.frames);
  return {.features_ns = (now.times.features_ns - before.times.features_ns) / frames,
          .search_ns = (now.times.search_ns - before.times.search_ns) / frames,
          .verify_ns = (now.times.verify_ns - before.times.verify_ns) / frames,
          .update_ns = (now.times.update_ns - before.times.update_ns) / frames,
          .total_ns = (now.times.total_ns - before.times.total_ns) / frames};
}

}  // namespace

StatsRecord StatsMeter::record(const Pipeline& pipeline, std::int64_t now_ns) {
  const DetectTotals now = pipeline.totals();
  StatsRecord record;
  record.time_ns = now_ns;
  record.uptime_ns = now_ns - started_ns_;
  record.frames = now.frames;
  record.dropped = pipeline.dropped_frames();
  record.corrupt = pipeline.capture().corrupt;
  record.restamped = pipeline.restamped_frames();
  record.camera_losses = pipeline.capture().losses;
  record.errors = now.errors;
  record.loops = now.loops;
  record.candidates = now.candidates;
  record.images = now.images;
  record.words_points = now.words_points;
  record.words_lines = now.words_lines;
  record.bytes = now.bytes;
  record.budget_bytes = pipeline.map_bytes();
  record.evictions = now.evictions;
  if (now_ns > before_ns_)
    record.frame_rate_hz = static_cast<double>(now.frames - before_.frames) * 1e9 /
                           static_cast<double>(now_ns - before_ns_);
  if (now.frames > before_.frames) record.stage_means = means(before_, now);
  before_ = now;
  before_ns_ = now_ns;
  return record;
}

std::string status_text(const StatsRecord& record, std::size_t clients) {
  const double rate_hz = std::round(record.frame_rate_hz.value_or(0) * 10) / 10;
  const std::string rate = std::to_string(rate_hz);
  return std::to_string(record.frames) + " frames (" + rate.substr(0, rate.find('.') + 2) + "/s, " +
         std::to_string(record.dropped) + " dropped), " + std::to_string(record.loops) +
         " loops, " + std::to_string(record.images) + " images, " +
         std::to_string(record.bytes >> 20) + " MiB, " + std::to_string(clients) + " clients";
}

}  // namespace loopd
