#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "app/daemon_config.h"
#include "app/event_loop.h"
#include "app/liveness.h"
#include "app/pipeline.h"
#include "app/service_notifier.h"
#include "app/stats_meter.h"
#include "base/log.h"
#include "base/result.h"
#include "events/event_server.h"

namespace loopd {

/// The daemon's main thread: an event loop that serves clients, signals, systemd and the log, while
/// a Pipeline captures and detects. Thread: bound to the one that makes it.
class Daemon {
 public:
  /// Opens the camera and listens on the socket; tells systemd that it is ready. Preconditions:
  /// validate(config) is empty; every signal but those of faults is blocked in every thread.
  /// Errors: camera, socket, threads.
  static Result<std::unique_ptr<Daemon>> start(const DaemonConfig& config, const Log& log,
                                               const std::string& version);
  ~Daemon();
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  /// Runs until SIGTERM, SIGINT or, if so configured, the end of the recording, and then ends all:
  /// capture, detection, clients. Error: the pipeline broke; there is nothing left but to restart.
  Status run();

 private:
  Daemon(const DaemonConfig& config, const Log& log, std::unique_ptr<EventLoop> loop,
         std::unique_ptr<Pipeline> pipeline, std::unique_ptr<EventServer> server);

  Status add_sources();
  Status start_pipeline_when_awaited();
  void take_from_pipeline();
  void publish(const TakenReport& taken);
  void tell(const Notice& notice);
  void publish_stats();
  void feed_watchdog();
  void end_on_signal(const char* name);
  Status shut_down();
  Status send_what_is_queued();

  const DaemonConfig config_;
  const Log log_;
  const ServiceNotifier systemd_;
  std::unique_ptr<EventLoop> loop_;
  std::unique_ptr<Pipeline> pipeline_;
  std::unique_ptr<EventServer> server_;
  StatsMeter stats_;
  std::optional<Liveness> liveness_;  ///< none: systemd watches not
  bool pipeline_started_ = false;
  bool ending_ = false;
  std::int64_t patience_with_clients_ns_;  ///< to take what is queued, once ending
  std::uint64_t dropped_reports_told_ = 0;
};

}  // namespace loopd
