#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "loopd/config.h"

namespace loopd {

// Every parameter has its default here and its unit, range and reason in the table behind
// `daemon_parameters()`; the shipped config/loopd.toml is held equal to both by a test.

/// Where frames come from.
struct CameraConfig {
  std::string name = "front";
  std::string source = "file";
  std::string path;
  int width = 640;
  int height = 480;
  double fps = 0;
  std::string format = "auto";
  std::string controls;
  double nominal_fps = 0;
  bool loop = false;
  int start = 0;
  bool exit_at_end = false;
  int wait_for_clients = 0;
  std::string faults;
  int max_pixels = 8'388'608;
  int buffers = 4;

  /// A real camera, which comes and goes; else a recording.
  bool live() const { return source != "file"; }
  /// The source waits for the detector and nothing is dropped.
  bool lock_step() const { return !live() && fps == 0; }
};

/// CPUs (empty: all the process may use) and real-time priority (0: none) of each thread.
struct ThreadsConfig {
  int lanes = 2;
  std::vector<int> capture_cpus;
  int capture_priority = 0;
  std::vector<int> detect_cpus;
  int detect_priority = 0;
  std::vector<int> lines_cpus;
  int lines_priority = 0;
  std::vector<int> main_cpus;
  int main_priority = 0;
  bool required = false;
};

/// The sockets.
struct EventsConfig {
  std::string socket;
  std::string control_socket;
  int max_clients = 64;
  int client_queue_kib = 256;
  double stalled_client_s = 30;
  double stats_interval_s = 5;
  int history_kib = 1024;
  int report_queue = 16;
};

/// Memory.
struct MemoryConfig {
  int budget_mib = 256;
  bool lock = false;
};

/// Everything the daemon is told. Plain values: copy it, change it, `validate` it once.
struct DaemonConfig {
  CameraConfig camera;
  ThreadsConfig threads;
  EventsConfig events;
  MemoryConfig memory;
  Config detector;
};

/// All parameters, the daemon's own and then the detector's, in the order of the config file.
/// Thread-safe.
std::span<const Parameter<DaemonConfig>> daemon_parameters();

/// All violations of range and rule, one sentence each, beginning with the key; empty if `config`
/// may be used.
std::vector<std::string> validate(const DaemonConfig& config);

/// What the daemon needs beyond a valid config (the tools do not): a camera to open.
std::vector<std::string> missing_for_daemon(const DaemonConfig& config);

/// events.socket, or where the socket is if that is empty: /run/loopd/<camera.name>/events.sock.
std::string event_socket_path(const DaemonConfig& config);

/// The path of another file that belongs to the event socket: /run/loopd/front/events.sock and
/// "ledger" give /run/loopd/front/ledger; a socket of another name, such as /tmp/a.sock, gives
/// /tmp/a.ledger, so that many may share a folder.
std::string beside_event_socket(const DaemonConfig& config, const std::string& name);

/// events.control_socket, or "control.sock" beside the event socket.
std::string control_socket_path(const DaemonConfig& config);

/// camera.controls, "name=value" separated by spaces, taken apart; what is not of this
/// form has an empty name.
std::vector<std::pair<std::string, std::string>> camera_controls(const CameraConfig& camera);

}  // namespace loopd
