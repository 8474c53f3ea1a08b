#include "loopeval/summary.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>
#include <variant>

namespace loopd::loopeval {
namespace {

using Json = nlohmann::ordered_json;

double to_ms(std::int64_t ns) { return static_cast<double>(ns) / 1e6; }

// The smallest of `sorted` that at least `percent` of them do not exceed.
double percentile_ms(const std::vector<std::int64_t>& sorted, std::size_t percent) {
  const std::size_t rank = (sorted.size() * percent + 99) / 100;
  return to_ms(sorted[std::max<std::size_t>(rank, 1) - 1]);
}

Json json_value(const ParameterRef& ref) {
  return std::visit([](const auto* value) { return Json(*value); }, ref);
}

Json config_json(DaemonConfig config) {
  Json json = Json::object();
  for (const Parameter<DaemonConfig>& parameter : daemon_parameters())
    json[std::string(parameter.key)] = json_value(parameter.ref(config));
  return json;
}

Json outcomes_json(const Summary& summary) {
  Json json = Json::object();
  for (std::size_t i = 0; i < kOutcomes; ++i)
    json[std::string(outcome_name(static_cast<Outcome>(i)))] = summary.outcomes[i];
  json["unreadable"] = summary.unreadable;
  return json;
}

Json stages_json(const Summary& summary) {
  Json json = Json::object();
  for (std::size_t i = 0; i < kStageNames.size(); ++i) {
    const TimeStatistics s = time_statistics(summary.stage_ns[i]);
    json[kStageNames[i]] = {{"mean", s.mean_ms},
                            {"p50", s.p50_ms},
                            {"p95", s.p95_ms},
                            {"p99", s.p99_ms},
                            {"max", s.max_ms}};
  }
  return json;
}

double wall_ms_per_frame(const Summary& summary) {
  return summary.frames > 0 ? to_ms(summary.wall_ns) / static_cast<double>(summary.frames) : 0;
}

template <class... Values>
std::string line(const char* format, Values... values) {
  std::array<char, 256> text{};
  std::snprintf(text.data(), text.size(), format, values...);
  return std::string(text.data()) + "\n";
}

std::string outcomes_text(const Summary& summary) {
  std::string text = "outcomes:";
  const char* separator = " ";
  const auto add = [&](std::string_view name, std::size_t count) {
    if (count == 0) return;
    text += separator + std::string(name) + " " + std::to_string(count);
    separator = ", ";
  };
  for (std::size_t i = 0; i < kOutcomes; ++i)
    add(outcome_name(static_cast<Outcome>(i)), summary.outcomes[i]);
  add("unreadable", summary.unreadable);
  return text + "\n";
}

std::string stages_text(const Summary& summary) {
  std::string text =
      line("%-10s %9s %9s %9s %9s %9s", "stage (ms)", "mean", "p50", "p95", "p99", "max");
  for (std::size_t i = 0; i < kStageNames.size(); ++i) {
    const TimeStatistics s = time_statistics(summary.stage_ns[i]);
    text += line("%-10s %9.3f %9.3f %9.3f %9.3f %9.3f", kStageNames[i], s.mean_ms, s.p50_ms,
                 s.p95_ms, s.p99_ms, s.max_ms);
  }
  return text;
}

}  // namespace

void Summary::add(const Report& report) {
  ++frames;
  ++outcomes[static_cast<std::size_t>(report.outcome)];
  const StageTimes& t = report.times;
  const std::array times = {t.features_ns, t.search_ns, t.verify_ns, t.update_ns, t.total_ns};
  for (std::size_t i = 0; i < times.size(); ++i) stage_ns[i].push_back(times[i]);
  max_points = std::max(max_points, report.points);
  max_lines = std::max(max_lines, report.lines);
  words_points = report.words_points;
  words_lines = report.words_lines;
  images = report.images;
  bytes = report.bytes;
}

void Summary::add_unreadable() {
  ++frames;
  ++unreadable;
}

TimeStatistics time_statistics(std::vector<std::int64_t> times_ns) {
  if (times_ns.empty()) return {};
  std::sort(times_ns.begin(), times_ns.end());
  const std::int64_t sum = std::accumulate(times_ns.begin(), times_ns.end(), std::int64_t{0});
  return {.mean_ms = to_ms(sum) / static_cast<double>(times_ns.size()),
          .p50_ms = percentile_ms(times_ns, 50),
          .p95_ms = percentile_ms(times_ns, 95),
          .p99_ms = percentile_ms(times_ns, 99),
          .max_ms = to_ms(times_ns.back())};
}

std::string summary_json(const Summary& summary, const DaemonConfig& config) {
  const Json json = {{"version", LOOPD_VERSION},
                     {"source", summary.source},
                     {"frames", summary.frames},
                     {"loops", summary.loops()},
                     {"outcomes", outcomes_json(summary)},
                     {"stage_ms", stages_json(summary)},
                     {"wall_s", to_ms(summary.wall_ns) / 1e3},
                     {"wall_ms_per_frame", wall_ms_per_frame(summary)},
                     {"words_points", summary.words_points},
                     {"words_lines", summary.words_lines},
                     {"images", summary.images},
                     {"bytes", summary.bytes},
                     {"max_points", summary.max_points},
                     {"max_lines", summary.max_lines},
                     {"config", config_json(config)}};
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string summary_text(const Summary& summary) {
  return summary.source + "\n" + line("%zu frames, %zu loops", summary.frames, summary.loops()) +
         outcomes_text(summary) +
         line("map: %zu images, %zu words of points, %zu of lines, %.1f MiB", summary.images,
              summary.words_points, summary.words_lines,
              static_cast<double>(summary.bytes) / (1 << 20)) +
         stages_text(summary) +
         line("wall time: %.1f s, %.1f ms a frame, reading the images included",
              to_ms(summary.wall_ns) / 1e3, wall_ms_per_frame(summary));
}

}  // namespace loopd::loopeval
