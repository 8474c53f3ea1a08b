#include "app/daemon_config.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <optional>
#include <utility>

#include "app/memory_plan.h"
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
        "Kind of camera. \"v4l2\": a camera of the kernel, such as a USB camera. \"libcamera\": "
        "one "
        "that libcamera drives. \"file\": recorded images stand in for one.",
        LOOPD_REF(camera.source)},
    Row{"camera.path", "", 0, 4096,
        "Which one. v4l2: a device (/dev/video0, or a link of /dev/v4l/by-id, which stays with the "
        "camera), or serial:NUMBER. libcamera: its id, or a part of it; empty = the only one. "
        "file: "
        "a folder of images (or a dataset folder with images/ in it), an image, a video, or what "
        "loopctl record wrote.",
        LOOPD_REF(camera.path)},
    Row{"camera.width", "px", 0, 16'384,
        "Wished of a live camera, which gives the nearest it has; 0 = as the driver is set. More "
        "than "
        "features.max_pixels is only work.",
        LOOPD_REF(camera.width)},
    Row{"camera.height", "px", 0, 16'384, "As camera.width.", LOOPD_REF(camera.height)},
    Row{"camera.fps", "frames/s", 0, 1000,
        "Live: the rate wished, 0 = the driver's own. File: the rate in real time, the newest "
        "frame "
        "wins, older ones are dropped and counted; 0 = lock-step: the source waits for the "
        "detector, "
        "nothing is dropped.",
        LOOPD_REF(camera.fps)},
    Row{"camera.format", "", 1, 8,
        "Pixel format of a live camera by its four letters (GREY, YUYV, NV12, MJPG, ...); \"auto\" "
        "= "
        "the one that costs least among those that reach size and rate.",
        LOOPD_REF(camera.format)},
    Row{"camera.controls", "", 0, 4096,
        "Controls of a live camera, such as \"auto_exposure=1 exposure_time_absolute=80 gain=20\", "
        "set in this order each time it is opened. Names: v4l2-ctl -L, or cam --list-controls. A "
        "short exposure blurs less when the robot turns.",
        LOOPD_REF(camera.controls)},
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
        "no longer one. Its twin for whole packets stands beside it, as events.seqpacket.",
        LOOPD_REF(events.socket)},
    Row{"events.control_socket", "", 0, kLongestSocketPath,
        "Path of the socket for those who may change what the daemon does, its owner and group; "
        "empty = control.sock in the folder of events.sock, NAME.control.sock beside NAME.sock.",
        LOOPD_REF(events.control_socket)},
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
    Row{"events.history_kib", "KiB", 0, 1'048'576,
        "Newest records that are kept for clients that connect again; 0 = none.",
        LOOPD_REF(events.history_kib)},
    Row{"events.report_queue", "reports", 4, 1024,
        "Reports on their way from the detector to the socket, about 84 KiB each. In real time "
        "what does not fit is dropped and counted, rejected candidates first; in lock-step the "
        "detector waits.",
        LOOPD_REF(events.report_queue)},

    Row{"memory.budget_mib", "MiB", 16, 1'048'576,
        "For everything that grows and every buffer: frames, reports, queues of clients, and what "
        "is left for the map. When the map is full, images that others cover are forgotten. "
        "loopd --check shows the parts.",
        LOOPD_REF(memory.budget_mib)},
    Row{"memory.lock", "", 0, 1,
        "Keep all of it in physical memory from the start, so that no frame waits for a page. "
        "Needs LimitMEMLOCK= above the budget.",
        LOOPD_REF(memory.lock)},
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

std::string violation(std::string_view key, const std::string& value, std::string_view rule) {
  return std::string(key) + " = " + toml_string(value) +
         ". Violated constraint: " + std::string(key) + " " + std::string(rule);
}

std::vector<std::string> camera_violations(const CameraConfig& camera) {
  constexpr std::array<std::string_view, 3> kSources = {"file", "v4l2", "libcamera"};
  std::vector<std::string> violations;
  if (std::ranges::find(kSources, camera.source) == kSources.end())
    violations.push_back(
        violation("camera.source", camera.source, "is \"file\", \"v4l2\" or \"libcamera\""));
  if (std::ranges::any_of(camera_controls(camera), [](const auto& c) { return c.first.empty(); }))
    violations.push_back(violation("camera.controls", camera.controls,
                                   "is a list of name=value, separated by spaces"));
  if (camera.live() && !camera.faults.empty())
    violations.push_back(
        violation("camera.faults", camera.faults, "is empty, but for camera.source = \"file\""));
  return violations;
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
  for (std::string& text : camera_violations(config.camera)) violations.push_back(std::move(text));
  Config detector = config.detector;
  detector.memory_budget_bytes = std::numeric_limits<std::int64_t>::max();
  for (std::string& text : validate(detector)) violations.push_back(std::move(text));
  if (violations.empty())
    if (auto text = budget_violation(config)) violations.push_back(*std::move(text));
  return violations;
}

std::vector<std::string> missing_for_daemon(const DaemonConfig& config) {
  if (!config.camera.path.empty() || config.camera.source == "libcamera") return {};
  if (config.camera.source == "v4l2")
    return {
        "camera.path is not set: give a device such as /dev/video0, in the config file or with "
        "--set camera.path=PATH; loopctl cameras lists what is there"};
  return {
      "camera.path is not set: give a folder of images or a video, in the config file or with "
      "--set camera.path=PATH; for a camera, set camera.source too"};
}

std::string event_socket_path(const DaemonConfig& config) {
  if (!config.events.socket.empty()) return config.events.socket;
  return "/run/loopd/" + config.camera.name + "/events.sock";
}

std::string beside_event_socket(const DaemonConfig& config, const std::string& name) {
  const std::filesystem::path events = event_socket_path(config);
  if (events.filename() == "events.sock") return events.parent_path() / name;
  return events.parent_path() / (events.stem().string() + "." + name);
}

std::string control_socket_path(const DaemonConfig& config) {
  if (!config.events.control_socket.empty()) return config.events.control_socket;
  return beside_event_socket(config, "control.sock");
}

std::vector<std::pair<std::string, std::string>> camera_controls(const CameraConfig& camera) {
  constexpr std::string_view kSeparators = " ";
  const std::string_view text = camera.controls;
  std::vector<std::pair<std::string, std::string>> controls;
  std::size_t begin = text.find_first_not_of(kSeparators);
  while (begin != std::string_view::npos) {
    const std::size_t end = std::min(text.find_first_of(kSeparators, begin), text.size());
    const std::string_view item = text.substr(begin, end - begin);
    const std::size_t equals = std::min(item.find('='), item.size());
    const bool complete = equals > 0 && equals + 1 < item.size();
    controls.emplace_back(complete ? item.substr(0, equals) : "",
                          complete ? item.substr(equals + 1) : "");
    begin = text.find_first_not_of(kSeparators, end);
  }
  return controls;
}

}  // namespace loopd
