#include "loopctl/render.h"

#include <time.h>

#include <array>
#include <cstdint>
#include <cstdio>

namespace loopd::loopctl {

namespace {

std::string ms(const Json& us) { return scaled(us, 1e-3, 1); }

std::string duration(const Json& ns) {
  if (!ns.is_number()) return "?";
  const auto s = static_cast<std::int64_t>(ns.get<double>() * 1e-9);
  if (s < 60) return std::to_string(s) + " s";
  if (s < 3600) return std::to_string(s / 60) + " min " + std::to_string(s % 60) + " s";
  return std::to_string(s / 3600) + " h " + std::to_string(s / 60 % 60) + " min";
}

/// "121 points, 22 lines" of the inliers, with their sum in front.
std::string inliers_text(const Json& inliers) {
  const Json& points = member(inliers, "points");
  const Json& lines = member(inliers, "lines");
  std::string sum = "?";
  if (points.is_number_integer() && lines.is_number_integer()) {
    sum = std::to_string(points.get<std::int64_t>() + lines.get<std::int64_t>());
  }
  return "inliers " + sum + ": " + text_of(points) + " points, " + text_of(lines) + " lines";
}

std::string evidence(const Json& record) {
  std::string text = inliers_text(member(record, "inliers"));
  text += "; similarity " + scaled(member(record, "similarity"), 1, 2);
  const Json& total = member(member(record, "latency_us"), "total");
  if (total.is_number()) text += "; " + scaled(total, 1e-3, 0) + " ms";
  return text;
}

std::string frames(const Json& record, const char* relation) {
  return "frame " + text_of(member(record, "query"), "frame_seq") + relation + "frame " +
         text_of(member(record, "match"), "frame_seq");
}

std::string loop_line(const Json& record) {
  return "LOOP " + frames(record, " = ") + " (" + evidence(record) + ")";
}

std::string candidate_line(const Json& record) {
  return "candidate " + frames(record, " ? ") + " rejected: " + text_of(record, "reason") + " (" +
         evidence(record) + ")";
}

std::string state_line(const Json& record) {
  std::string line = "STATE " + text_of(record, "state");
  if (member(record, "fault").is_string()) line += " (" + text_of(record, "fault") + ")";
  if (member(record, "cause").is_string()) line += ": " + text_of(record, "cause");
  if (member(record, "remedy").is_string()) line += " [" + text_of(record, "remedy") + "]";
  return line;
}

std::string frames_text(const Json& stats) {
  const Json& rate = member(stats, "frame_rate_hz");
  return text_of(stats, "frames") + " frames" +
         (rate.is_number() ? " (" + scaled(rate, 1, 1) + "/s)" : "") + ", " +
         text_of(stats, "dropped") + " dropped, " + text_of(stats, "corrupt") + " corrupt, " +
         text_of(stats, "errors") + " failed";
}

/// What there is to say of the camera; empty if all is well.
std::string camera_text(const Json& stats) {
  const double losses = number_of(stats, "camera_losses");
  const double restamped = number_of(stats, "restamped");
  std::string text;
  if (losses > 0) text = "lost " + decimal(losses, 0) + (losses == 1 ? " time" : " times");
  if (restamped > 0) {
    text += (text.empty() ? "" : ", ") + decimal(restamped, 0) + " frames with a replaced time";
  }
  return text;
}

std::string map_text(const Json& stats) {
  return text_of(stats, "images") + " images, " + text_of(stats, "words_points") +
         " point words, " + text_of(stats, "words_lines") + " line words, " +
         mib(member(stats, "bytes"));
}

std::string stages_text(const Json& mean_us) {
  std::string text;
  for (const char* stage : {"features", "search", "verify", "update", "total"}) {
    text += std::string(text.empty() ? "" : ", ") + stage + " " + ms(member(mean_us, stage));
  }
  return text;
}

std::string stats_line(const Json& record) {
  std::string line = "STATS " + frames_text(record) + "; " + text_of(record, "loops") + " loops; " +
                     map_text(record);
  const Json& mean_us = member(record, "mean_us");
  if (mean_us.is_object()) line += "; mean " + ms(member(mean_us, "total")) + " ms";
  return line;
}

std::string gap_line(const Json& record) {
  const Json& count = member(record, "count");
  const Json& epoch = member(record, "of_epoch");
  std::string line = "GAP " + (count.is_null() ? "some" : text_of(count)) + " records missed";
  if (!member(record, "first").is_null()) {
    line += " (seq " + text_of(record, "first") + " to " + text_of(record, "last") + ")";
  }
  if (!epoch.is_null()) return line + " of epoch " + text_of(epoch);
  return line + ": this reader was too slow";
}

std::string hello_line(const Json& record) {
  return "connected to loopd " + text_of(record, "version") + ", camera " +
         text_of(record, "camera");
}

std::string row(const char* name, const std::string& text) {
  std::string line = "  " + std::string(name);
  line.resize(12, ' ');
  return line + text + "\n";
}

}  // namespace

std::string record_line(const Json& record) {
  const std::string record_class = text_of(record, "class");
  if (record_class == "loop") return loop_line(record);
  if (record_class == "candidate") return candidate_line(record);
  if (record_class == "state") return state_line(record);
  if (record_class == "stats") return stats_line(record);
  if (record_class == "gap") return gap_line(record);
  if (record_class == "error") return "ERROR " + text_of(record, "message");
  if (record_class == "hello") return hello_line(record);
  if (record_class == "watch") return {};
  return printable(text_of(record));
}

std::string status_block(const Json& hello, const Json& state, const Json& stats,
                         const std::string& socket_path) {
  const std::string now = state.is_null() ? "no state known yet" : text_of(state, "state");
  std::string text = "camera " + text_of(hello, "camera") + ": " + now + "\n";
  if (member(state, "fault").is_string()) text += row("fault", text_of(state, "fault"));
  if (member(state, "cause").is_string()) text += row("cause", text_of(state, "cause"));
  if (member(state, "remedy").is_string()) text += row("remedy", text_of(state, "remedy"));
  text +=
      row("daemon", "loopd " + text_of(hello, "version") + ", epoch " + text_of(hello, "epoch"));
  text += row("socket", printable(socket_path));
  if (stats.is_null()) return text + row("frames", "no counters known yet");
  text += row("up", duration(member(stats, "uptime_ns")));
  text += row("frames", frames_text(stats));
  if (const std::string camera = camera_text(stats); !camera.empty()) text += row("camera", camera);
  text += row("loops", text_of(stats, "loops") + " accepted, " + text_of(stats, "candidates") +
                           " candidates rejected");
  text += row("map", map_text(stats));
  if (const Json& mean_us = member(stats, "mean_us"); mean_us.is_object()) {
    text += row("mean ms", stages_text(mean_us));
  }
  return text + row("clients", text_of(stats, "clients") + " connected, " +
                                   text_of(stats, "missed_records") + " records missed");
}

std::string time_of_day() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  tm local{};
  localtime_r(&now.tv_sec, &local);
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), "%02d:%02d:%02d.%03d", local.tm_hour, local.tm_min,
                local.tm_sec, static_cast<int>(now.tv_nsec / 1'000'000));
  return text.data();
}

}  // namespace loopd::loopctl
