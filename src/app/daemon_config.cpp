#include "app/daemon_config.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <optional>
#include <utility>

#include "app/parameter_text.h"

namespace loopd {
namespace {

using Row = Parameter<DaemonConfig>;

#define LOOPD_REF(field) [](DaemonConfig& c) -> ParameterRef { return &c.field; }

constexpr int kLongestSocketPath = 107;  // sizeof(sockaddr_un::sun_path) - 1
constexpr int kCpus = 1024;              // CPU_SETSIZE

// Key, unit, smallest, largest, what it does and why the default is what it is.
const std::array kOwnParameters = {
    Row{"camera.name", "", 1, 64,
        "Name of the camera: in every event's greeting and in the path of the socket. Letters, "
        "digits, - and _.",
        LOOPD_REF(camera.name)},
    Row{"camera.source", "", 1, 16,
        "Kind of camera. \"file\": a folder of images, or a video, stands in for one.",
        LOOPD_REF(camera.source)},
    Row{"camera.path", "", 0, 4096,
        "The folder of images (or a dataset folder with images/ in it), the image or the video. "
        "The daemon does not start without one.",
        LOOPD_REF(camera.path)},
    Row{"camera.fps", "frames/s", 0, 1000,
        "Rate in real time: the newest frame wins, older ones are dropped and counted. 0 = "
        "lock-step: the source waits for the detector, nothing is dropped; for replay and tests.",
        LOOPD_REF(camera.fps)},
    Row{"camera.nominal_fps", "frames/s", 0, 1000,
        "In lock-step, the rate from which frame times are made where the recording has none; 0 = "
        "that of a video, no times for images.",
        LOOPD_REF(camera.nominal_fps)},
    Row{"camera.loop", "", 0, 1, "Start the recording over at its end, without end.",
        LOOPD_REF(camera.loop)},
    Row{"camera.start", "frames", 0, 1'000'000'000, "Index of the first frame to take.",
        LOOPD_REF(camera.start)},
    Row{"camera.exit_at_end", "", 0, 1,
        "Exit with 0 at the end of a recording; if not, the daemon stays and serves its clients, "
        "as it does when a camera is lost.",
        LOOPD_REF(camera.exit_at_end)},
    Row{"camera.wait_for_clients", "clients", 0, 1024,
        "Take the first frame only when this many clients are connected, so that a replay is seen "
        "from its start.",
        LOOPD_REF(camera.wait_for_clients)},
    Row{"camera.faults", "", 0, 4096,
        "Scripted faults for trials, such as \"stall@100:2s drop@50:3 corrupt@70 unplug@200:5s "
        "jump@300:+3600s\" (frame:duration or count).",
        LOOPD_REF(camera.faults)},
    Row{"camera.max_pixels", "px", 64, 100'000'000,
        "A frame with more is refused. Bounds the buffers, one byte a pixel; the default is 12 "
        "megapixels, and what smaller frames never touch stays unused address space.",
        LOOPD_REF(camera.max_pixels)},
    Row{"camera.buffers", "frames", 3, 64,
        "Frame buffers: one being filled, one waiting, one in the detector, one to spare.",
        LOOPD_REF(camera.buffers)},

    Row{"threads.lanes", "threads", 1, 2,
        "2 = points and lines are worked on side by side by two threads; 1 = one after the other, "
        "with the same results.",
        LOOPD_REF(threads.lanes)},
    Row{"threads.capture_cpus", "CPU numbers", 0, kCpus - 1,
        "CPUs of the thread that takes frames; [] = any.", LOOPD_REF(threads.capture_cpus)},
    Row{"threads.capture_priority", "SCHED_FIFO", 0, 99,
        "Its real-time priority; 0 = the ordinary scheduler. Needs LimitRTPRIO= or CAP_SYS_NICE.",
        LOOPD_REF(threads.capture_priority)},
    Row{"threads.detect_cpus", "CPU numbers", 0, kCpus - 1,
        "CPUs of the detector (its points lane); [] = any.", LOOPD_REF(threads.detect_cpus)},
    Row{"threads.detect_priority", "SCHED_FIFO", 0, 99, "Its real-time priority; 0 = none.",
        LOOPD_REF(threads.detect_priority)},
    Row{"threads.lines_cpus", "CPU numbers", 0, kCpus - 1,
        "CPUs of the detector's lines lane; [] = any. Give it another core than the points lane.",
        LOOPD_REF(threads.lines_cpus)},
    Row{"threads.lines_priority", "SCHED_FIFO", 0, 99, "Its real-time priority; 0 = none.",
        LOOPD_REF(threads.lines_priority)},
    Row{"threads.main_cpus", "CPU numbers", 0, kCpus - 1,
        "CPUs of the thread that serves sockets, signals and the watchdog; [] = any.",
        LOOPD_REF(threads.main_cpus)},
    Row{"threads.main_priority", "SCHED_FIFO", 0, 99, "Its real-time priority; 0 = none.",
        LOOPD_REF(threads.main_priority)},
    Row{"threads.required", "", 0, 1,
        "Refuse to start if a thread cannot have its CPUs and priority; if not, that is a warning.",
        LOOPD_REF(threads.required)},

    Row{"events.socket", "", 0, kLongestSocketPath,
        "Path of the event socket; empty = /run/loopd/<camera.name>/events.sock. The kernel takes "
        "no longer one.",
        LOOPD_REF(events.socket)},
    Row{"events.max_clients", "clients", 1, 1024, "One more is told so and closed.",
        LOOPD_REF(events.max_clients)},
    Row{"events.client_queue_kib", "KiB", 4, 65'536,
        "Queue of each client. A client too slow for it misses records and is told how many.",
        LOOPD_REF(events.client_queue_kib)},
    Row{"events.stalled_client_s", "s", 0.1, 86'400,
        "A client whose queue is full and who has read nothing for this long is disconnected.",
        LOOPD_REF(events.stalled_client_s)},
    Row{"events.stats_interval_s", "s", 0.05, 3600,
        "Between two records of counters, and between two updates of the service's status.",
        LOOPD_REF(events.stats_interval_s)},
    Row{"events.report_queue", "reports", 4, 1024,
        "Reports on their way from the detector to the socket, about 84 KiB each. In real time "
        "what does not fit is dropped and counted, rejected candidates first; in lock-step the "
        "detector waits.",
        LOOPD_REF(events.report_queue)},
};

#undef LOOPD_REF

/// The detector's parameter I, found inside a DaemonConfig. A table of these, since a row holds a
/// plain function.
template <std::size_t I>
ParameterRef detector_ref(DaemonConfig& config) {
  return parameters()[I].ref(config.detector);
}
constexpr std::size_t kMostDetectorParameters = 128;
template <std::size_t... I>
constexpr auto detector_refs(std::index_sequence<I...>) {
  return std::array{&detector_ref<I>...};
}

std::vector<Row> all_parameters() {
  constexpr auto kRefs = detector_refs(std::make_index_sequence<kMostDetectorParameters>());
  assert(parameters().size() <= kRefs.size());
  std::vector<Row> rows(kOwnParameters.begin(), kOwnParameters.end());
  for (std::size_t i = 0; i < parameters().size(); ++i) {
    const Parameter<Config>& p = parameters()[i];
    rows.push_back({p.key, p.unit, p.min, p.max, p.reason, kRefs[i]});
  }
  return rows;
}

bool is_name_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
         c == '_';
}

}  // namespace

std::span<const Parameter<DaemonConfig>> daemon_parameters() {
  static const std::vector<Row> rows = all_parameters();
  return rows;
}

std::vector<std::string> validate(const DaemonConfig& config) {
  std::vector<std::string> violations;
  DaemonConfig copy = config;
  for (const Row& row : kOwnParameters)
    if (auto text = range_violation(row.key, row.ref(copy), row.min, row.max))
      violations.push_back(*std::move(text));
  if (!std::ranges::all_of(config.camera.name, is_name_character))
    violations.push_back("camera.name = " + toml_string(config.camera.name) +
                         ". Violated constraint: camera.name holds only letters, digits, - and _");
  if (config.camera.source != "file")
    violations.push_back("camera.source = " + toml_string(config.camera.source) +
                         ". Violated constraint: camera.source is \"file\", the only kind of "
                         "camera this version has");
  for (std::string& text : validate(config.detector)) violations.push_back(std::move(text));
  return violations;
}

std::vector<std::string> missing_for_daemon(const DaemonConfig& config) {
  if (!config.camera.path.empty()) return {};
  return {
      "camera.path is not set: give a folder of images or a video, in the config file or with "
      "--set camera.path=PATH"};
}

std::string event_socket_path(const DaemonConfig& config) {
  if (!config.events.socket.empty()) return config.events.socket;
  return "/run/loopd/" + config.camera.name + "/events.sock";
}

}  // namespace loopd
