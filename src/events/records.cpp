#include "events/records.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <charconv>
#include <cmath>

#include "events/json_text.h"

namespace loopd {

namespace {

using json_text::Json;
using json_text::set_finite;
using json_text::set_known;

constexpr std::array<std::string_view, 10> kStateNames = {
    "starting",   "running",        "camera_lost", "camera_back", "camera_stalled",
    "camera_end", "detector_error", "paused",      "map_reset",   "shutting_down"};
/// Spread is counted in cells of the query image (report.h): 8 x 6.
constexpr double kCells = 48;

std::int64_t to_us(std::int64_t ns) { return ns / 1000; }

Json start(std::string_view record_class, StreamPosition position) {
  return Json{{"class", record_class}, {"seq", position.seq}, {"epoch", position.epoch}};
}

Json since_json(const Since& since, const Resumed& resumed) {
  Json json{{"epoch", since.epoch}, {"seq", since.seq}, {"resumed", resumed.complete}};
  set_known(json, "missed", resumed.missed);
  if (!resumed.reason.empty()) json["reason"] = resumed.reason;
  return json;
}

Json query_json(const Report& report) {
  Json json{{"id", report.query}};
  set_known(json, "time_ns", report.time_ns);
  json["frame_seq"] = report.sequence;
  return json;
}

Json match_json(const Match& match) {
  Json json{{"id", match.image}};
  set_known(json, "time_ns", match.time_ns);
  json["frame_seq"] = match.sequence;
  return json;
}

Json island_json(const Island& island) {
  Json json{{"first", island.first}, {"last", island.last}};
  set_finite(json, "score", island.score);
  return json;
}

Json inliers_json(const Verification& verification) {
  Json json{{"points", verification.point_inliers}, {"lines", verification.line_inliers}};
  if (verification.matches() > 0) {
    json["ratio"] = static_cast<double>(verification.agreeing) / verification.matches();
  }
  json["spread"] = verification.cells / kCells;
  return json;
}

/// All zero means that none was found (report.h).
bool is_known(const std::array<double, 9>& matrix) {
  const bool finite =
      std::all_of(matrix.begin(), matrix.end(), [](double v) { return std::isfinite(v); });
  return finite && std::any_of(matrix.begin(), matrix.end(), [](double v) { return v != 0; });
}

void set_verification(Json& json, const Verification& verification) {
  json["inliers"] = inliers_json(verification);
  if (verification.inliers() == 0) return;  // no model was found: none to name
  json["model"] = model_name(verification.model);
  if (is_known(verification.fundamental)) json["F"] = verification.fundamental;
}

Json latency_json(const StageTimes& times, const Latency& latency) {
  Json json = Json::object();
  if (latency.capture_ns) json["capture"] = to_us(*latency.capture_ns);
  json["features"] = to_us(times.features_ns);
  json["search"] = to_us(times.search_ns);
  json["verify"] = to_us(times.verify_ns);
  if (latency.total_ns) json["total"] = to_us(*latency.total_ns);
  return json;
}

Json stage_means_json(const StageTimes& means) {
  return Json{{"features", to_us(means.features_ns)},
              {"search", to_us(means.search_ns)},
              {"verify", to_us(means.verify_ns)},
              {"update", to_us(means.update_ns)},
              {"total", to_us(means.total_ns)}};
}

/// The shortest text that reads back as the same float.
void append_number(std::string& text, float value) {
  std::array<char, 32> digits;
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  text.append(digits.data(), end);
}

bool is_finite(const InlierPair& pair) {
  return std::isfinite(pair.query_x_px) && std::isfinite(pair.query_y_px) &&
         std::isfinite(pair.match_x_px) && std::isfinite(pair.match_y_px);
}

void append_pair(std::string& text, const InlierPair& pair) {
  text += '[';
  for (float v : {pair.query_x_px, pair.query_y_px, pair.match_x_px, pair.match_y_px}) {
    append_number(text, v);
    text += ',';
  }
  text += pair.is_line ? "\"l\"]" : "\"p\"]";
}

/// `text` of an object with a member "pairs" added. Written by hand: there may be thousands, and
/// as doubles each coordinate would be twice as long.
std::string with_pairs(std::string text, const Report& report) {
  text.back() = ',';
  text += "\"pairs\":[";
  bool first = true;
  for (const InlierPair& pair : report.pairs) {
    if (!is_finite(pair)) continue;
    if (!first) text += ',';
    append_pair(text, pair);
    first = false;
  }
  return text + "]}";
}

}  // namespace

std::string_view state_name(State state) { return kStateNames[static_cast<std::size_t>(state)]; }

std::optional<RecordClass> record_class_of(const Report& report) {
  if (report.outcome == Outcome::kLoop) return RecordClass::kLoop;
  if (report.match) return RecordClass::kCandidate;
  return std::nullopt;
}

std::string hello_text(const Identity& identity, StreamPosition position) {
  return json_text::dump(Json{{"class", "hello"},
                              {"name", "loopd"},
                              {"version", identity.version},
                              {"protocol", {{"major", kProtocolMajor}, {"minor", kProtocolMinor}}},
                              {"epoch", identity.epoch},
                              {"seq", position.seq},
                              {"camera", identity.camera},
                              {"clock", identity.clock},
                              {"boot_id", identity.boot_id}});
}

std::string watch_text(const WatchRequest& request, const ClientPolicy& policy,
                       StreamPosition position, const Resumed& resumed) {
  Json json = start("watch", position);
  json["classes"] = Json::array();
  for (std::size_t i = 0; i < kRecordClasses; ++i) {
    const auto record_class = static_cast<RecordClass>(i);
    if (request.classes.has(record_class)) {
      json["classes"].push_back(record_class_name(record_class));
    }
  }
  json["pairs"] = request.pairs;
  if (request.since) json["since"] = since_json(*request.since, resumed);
  json["queue_bytes"] = policy.queue_bytes;
  json["max_line_bytes"] = policy.max_line_bytes;
  json["stalled_client_ms"] = policy.stalled_client_ms;
  json["history_bytes"] = policy.history_bytes;
  return json_text::dump(json);
}

std::string gap_text(const Gap& gap, StreamPosition position) {
  return gap_text(Loss{gap.count, gap.first_seq, gap.last_seq, {}}, position);
}

std::string gap_text(const Loss& loss, StreamPosition position) {
  Json json = start("gap", position);
  set_known(json, "count", loss.count);
  set_known(json, "first", loss.first_seq);
  set_known(json, "last", loss.last_seq);
  if (!loss.of_epoch.empty()) json["of_epoch"] = loss.of_epoch;
  return json_text::dump(json);
}

std::string error_text(std::string_view message, StreamPosition position) {
  Json json = start("error", position);
  json["message"] = message;
  return json_text::dump(json);
}

std::string report_text(const Report& report, const Latency& latency, StreamPosition position,
                        bool pairs) {
  const std::optional<RecordClass> record_class = record_class_of(report);
  assert(record_class);
  Json json = start(record_class_name(*record_class), position);
  if (*record_class == RecordClass::kCandidate) json["reason"] = outcome_name(report.outcome);
  json["query"] = query_json(report);
  if (report.match) json["match"] = match_json(*report.match);
  if (report.match) set_finite(json, "similarity", report.match->similarity);
  if (report.island) json["island"] = island_json(*report.island);
  if (report.verification) set_verification(json, *report.verification);
  json["latency_us"] = latency_json(report.times, latency);
  std::string text = json_text::dump(json);
  return pairs ? with_pairs(std::move(text), report) : text;
}

std::string state_text(const StateRecord& record, StreamPosition position, bool repeat) {
  Json json = start("state", position);
  if (repeat) json["repeat"] = true;
  json["time_ns"] = record.time_ns;
  json["state"] = state_name(record.state);
  if (!record.fault.empty()) json["fault"] = record.fault;
  if (!record.cause.empty()) json["cause"] = record.cause;
  if (!record.remedy.empty()) json["remedy"] = record.remedy;
  return json_text::dump(json);
}

std::string stats_text(const StatsRecord& record, const ServerStats& server,
                       StreamPosition position, bool repeat) {
  Json json = start("stats", position);
  if (repeat) json["repeat"] = true;
  json["time_ns"] = record.time_ns;
  json["uptime_ns"] = record.uptime_ns;
  json["frames"] = record.frames;
  json["dropped"] = record.dropped;
  json["corrupt"] = record.corrupt;
  json["errors"] = record.errors;
  json["loops"] = record.loops;
  json["candidates"] = record.candidates;
  json["images"] = record.images;
  json["words_points"] = record.words_points;
  json["words_lines"] = record.words_lines;
  json["bytes"] = record.bytes;
  json["budget_bytes"] = record.budget_bytes;
  json["evicted"] = {{"for_images", record.evictions.for_images},
                     {"for_words", record.evictions.for_words},
                     {"waiting", record.evictions.waiting},
                     {"not_kept", record.evictions.not_kept}};
  json["restamped"] = record.restamped;
  json["camera_losses"] = record.camera_losses;
  if (record.frame_rate_hz) set_finite(json, "frame_rate_hz", *record.frame_rate_hz);
  if (record.stage_means) json["mean_us"] = stage_means_json(*record.stage_means);
  json["clients"] = server.clients;
  json["missed_records"] = server.missed_records;
  return json_text::dump(json);
}

}  // namespace loopd
