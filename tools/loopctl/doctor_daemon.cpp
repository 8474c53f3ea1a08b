#include "loopctl/doctor_daemon.h"

#include <sys/stat.h>

#include "events/records.h"

namespace loopd::loopctl {

namespace {

constexpr const char* kTopic = "daemon";
constexpr mode_t kOthersWrite = 2;

bool is_state(const std::string& name, State state) { return name == state_name(state); }

Finding judge_state(const Json& state) {
  if (state.is_null()) return Finding::warning(kTopic, "it tells no state yet", "ask again");
  const std::string name = text_of(state, "state");
  if (is_state(name, State::kRunning) || is_state(name, State::kCameraBack) ||
      is_state(name, State::kMapReset))
    return Finding::ok(kTopic, "it is " + name);
  const Json& cause = member(state, "cause");
  const std::string text =
      "it is " + name + (cause.is_string() ? ": " + text_of(cause) : std::string());
  if (is_state(name, State::kPaused))
    return Finding::warning(kTopic, text, "loopctl resume lets it go on");
  if (is_state(name, State::kStarting) || is_state(name, State::kCameraEnd) ||
      is_state(name, State::kShuttingDown))
    return Finding::ok(kTopic, text);
  const Json& remedy = member(state, "remedy");
  return Finding::problem(kTopic, text, remedy.is_string() ? text_of(remedy) : std::string());
}

/// A warning if more than `limit` of all frames have the fault that `key` counts.
Findings judge_share(const Json& stats, const char* key, double limit, const std::string& what,
                     const std::string& remedy) {
  const double faulty = number_of(stats, key);
  const double all =
      number_of(stats, "frames") + number_of(stats, "dropped") + number_of(stats, "corrupt");
  if (faulty <= 0 || faulty <= limit * all) return {};
  return {Finding::warning(
      kTopic, decimal(faulty, 0) + " of " + decimal(all, 0) + " frames " + what, remedy)};
}

Findings judge_count(const Json& stats, const char* key, const std::string& what,
                     const std::string& remedy) {
  const double count = number_of(stats, key);
  if (count <= 0) return {};
  return {Finding::warning(kTopic, what + ": " + decimal(count, 0), remedy)};
}

Findings judge_stats(const Json& stats) {
  if (stats.is_null()) return {};
  Findings findings = {Finding::ok(kTopic, text_of(stats, "frames") + " frames, " +
                                               text_of(stats, "dropped") + " dropped, " +
                                               text_of(stats, "loops") + " loops")};
  // A detector that keeps up with half of the frames does well; far fewer, and places are missed.
  append(findings, judge_share(stats, "dropped", 0.75, "were dropped, the detector is too slow",
                               "lower camera.fps, features.points or features.max_pixels, or give "
                               "it a CPU of its own"));
  append(findings, judge_share(stats, "corrupt", 0.01, "were damaged",
                               "try another cable or port, without a hub"));
  append(findings, judge_share(stats, "restamped", 0.01, "came with times that cannot be believed",
                               "tell back-ends that times of frames are a little late and uneven"));
  append(findings, judge_share(stats, "errors", 0, "failed in the detector",
                               "send a recording of them (loopctl record)"));
  append(findings, judge_count(stats, "camera_losses", "times that the camera was lost",
                               "look at cable, plug and power; loopctl watch tells when and why"));
  append(findings, judge_count(stats, "missed_records", "records that clients were too slow for",
                               "read in a loop of its own, or raise events.client_queue_kib"));
  return findings;
}

}  // namespace

Findings judge_socket_file(const SocketFile& socket) {
  constexpr const char* kSocket = "socket";
  if (!socket.file) {
    if (!socket.expected) return {};
    return {Finding::problem(kSocket, socket.path + " is not there, though the daemon runs",
                             "start it anew: something has removed the file")};
  }
  if (!S_ISSOCK(socket.file->mode))
    return {Finding::problem(kSocket, socket.path + " is no socket", "remove it")};
  const bool others = (socket.file->mode & kOthersWrite) != 0;
  if (socket.control && others)
    return {Finding::problem(kSocket, "anybody may control the daemon by " + socket.path,
                             "sudo chmod o= " + socket.path)};
  if (!socket.control && !others)
    return {Finding::warning(kSocket, "not every user may read events from " + socket.path,
                             "sudo chmod a+rw " + socket.path)};
  const std::string who = socket.control ? " is for the group " + socket.file->group + " only"
                                         : " is there for every user";
  return {Finding::ok(kSocket, socket.path + who)};
}

Findings judge_daemon(const Snapshot& snapshot, const std::string& version) {
  Findings findings = {judge_state(snapshot.state)};
  if (const std::string running = text_of(snapshot.hello, "version"); running != version) {
    findings.push_back(Finding::warning(kTopic,
                                        "loopd " + running + " runs, but loopctl is " + version,
                                        "start the daemon anew: sudo systemctl restart loopd@" +
                                            text_of(snapshot.hello, "camera")));
  }
  append(findings, judge_stats(snapshot.stats));
  return findings;
}

}  // namespace loopd::loopctl
