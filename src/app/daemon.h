#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "app/config_file.h"
#include "app/daemon_config.h"
#include "app/event_loop.h"
#include "app/liveness.h"
#include "app/pipeline.h"
#include "app/remote_control.h"
#include "app/service_notifier.h"
#include "app/stats_meter.h"
#include "base/log.h"
#include "base/result.h"
#include "events/event_server.h"

namespace loopd {

/// The daemon's main thread: an event loop that serves clients, signals, systemd and the log, while
/// a Pipeline captures and detects. Thread: bound to the one that makes it.
class Daemon final : private Controllable {
 public:
  /// Reads the config anew, for a reload.
  using ReadConfig = std::function<LoadedConfig()>;

  /// Opens the camera and listens on the sockets (those that systemd hands over, the rest it
  /// makes); tells systemd that it is ready. Preconditions: validate(config) is empty; every signal
  /// but those of faults is blocked in every thread. Errors: camera, socket, threads.
  static Result<std::unique_ptr<Daemon>> start(const DaemonConfig& config, ReadConfig read_again,
                                               const Log& log, const std::string& version);
  virtual ~Daemon();
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  /// Runs until SIGTERM, SIGINT or, if so configured, the end of the recording, and then ends all:
  /// capture, detection, clients. Error: the pipeline broke; there is nothing left but to restart.
  Status run();

 private:
  Daemon(const DaemonConfig& config, ReadConfig read_again, const Log& log,
         std::unique_ptr<EventLoop> loop, std::unique_ptr<Pipeline> pipeline,
         std::unique_ptr<EventServer> server);

  void pause() override;
  void resume() override;
  void reset_map() override { pipeline_->reset_map(); }
  Result<std::string> reload() override;
  ControlFields status() const override;

  Status open_control(InheritedSockets& inherited, const Identity& identity);
  Status add_sources();
  void lock_memory();
  Status start_pipeline_when_awaited();
  void take_from_pipeline();
  void publish(const TakenReport& taken);
  void follow_map(std::uint32_t map);
  void tell_state_again();
  Result<std::string> take_over(const DaemonConfig& wanted);
  void tell(const Notice& notice);
  void publish_stats();
  void feed_watchdog();
  void watch_over_camera();
  void end_on_signal(const char* name);
  Status shut_down();
  Status send_what_is_queued();

  DaemonConfig config_;
  const ReadConfig read_again_;
  const Log log_;
  const ServiceNotifier systemd_;
  std::unique_ptr<EventLoop> loop_;
  std::unique_ptr<Pipeline> pipeline_;
  std::unique_ptr<EventServer> server_;
  std::unique_ptr<RemoteControl> control_;
  StateRecord state_;  ///< the newest of camera and detector, told again after a pause or a reset
  StatsMeter stats_;
  std::uint64_t watchdog_us_ = 0;     ///< systemd's; meaningless without liveness_
  std::optional<Liveness> liveness_;  ///< none: systemd watches not
  bool pipeline_started_ = false;
  bool ending_ = false;
  std::optional<Error> broken_;  ///< why it ends, if not by request
  bool paused_ = false;
  std::uint32_t map_ = 0;                  ///< the map that published image ids belong to
  std::int64_t patience_with_clients_ns_;  ///< to take what is queued, once ending
  std::uint64_t dropped_reports_told_ = 0;
};

}  // namespace loopd
