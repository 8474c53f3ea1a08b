#include "app/daemon.h"

#include <signal.h>
#include <sys/mman.h>
#include <sys/random.h>
#include <systemd/sd-daemon.h>

#include <array>
#include <cerrno>
#include <fstream>
#include <utility>

#include "app/message_ids.h"
#include "app/reload.h"
#include "base/clock.h"

namespace loopd {
namespace {

// A replay's readers get everything if they read at all; a stop by hand is over within a second.
constexpr std::int64_t kPatienceAtEnd_ns = 2'000'000'000;
constexpr std::int64_t kPatienceAtSignal_ns = 200'000'000;

std::string random_epoch() {
  constexpr std::string_view kHex = "0123456789abcdef";
  std::array<unsigned char, 8> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) < 0) return std::to_string(monotonic_now_ns());
  std::string text;
  for (const unsigned char byte : bytes) {
    text += kHex[byte >> 4];
    text += kHex[byte & 0xf];
  }
  return text;
}

Identity identity_of(const DaemonConfig& config, const std::string& version) {
  Identity identity;
  identity.version = version;
  identity.camera = config.camera.name;
  identity.epoch = random_epoch();
  std::ifstream("/proc/sys/kernel/random/boot_id") >> identity.boot_id;
  return identity;
}

/// The sockets that systemd listens on for us.
InheritedSockets inherited_sockets() {
  const int count = sd_listen_fds(1);  // not for children
  std::vector<UniqueFd> fds;
  for (int i = 0; i < count; ++i) fds.emplace_back(SD_LISTEN_FDS_START + i);
  return InheritedSockets(std::move(fds));
}

ServerOptions server_options(const DaemonConfig& config) {
  ServerOptions options;
  options.socket_path = event_socket_path(config);
  options.seqpacket_path = seqpacket_path(options.socket_path);
  options.ledger_path = beside_event_socket(config, "ledger");
  options.history_bytes = static_cast<std::size_t>(config.events.history_kib) * 1024;
  options.max_clients = config.events.max_clients;
  options.client_queue_bytes = static_cast<std::size_t>(config.events.client_queue_kib) * 1024;
  options.stalled_client =
      std::chrono::milliseconds(static_cast<std::int64_t>(config.events.stalled_client_s * 1e3));
  return options;
}

StateRecord state_now(State state, std::string cause) {
  return {state, monotonic_now_ns(), std::move(cause), ""};
}

std::pair<std::string_view, MessageId> title_of(const Notice& notice) {
  switch (notice.kind) {
    case Notice::Kind::kState:
      return {state_name(notice.record.state), kIdState};
    case Notice::Kind::kFrameLost:
      return {"frame lost", kIdFrameLost};
    case Notice::Kind::kCamera:
      return {"camera", kIdCamera};
  }
  return {"notice", {}};
}

Error mistakes_error(const LoadedConfig& loaded) {
  std::string text = "nothing was taken over, since the config has mistakes";
  for (const std::string& mistake : loaded.mistakes) text += "; " + mistake;
  return {std::move(text), EINVAL};
}

}  // namespace

Result<std::unique_ptr<Daemon>> Daemon::start(const DaemonConfig& config, ReadConfig read_again,
                                              const Log& log, const std::string& version) {
  auto loop = EventLoop::make();
  if (!loop) return loop.error();
  auto pipeline = Pipeline::open(config);
  if (!pipeline) return pipeline.error();
  InheritedSockets inherited = inherited_sockets();
  const Identity identity = identity_of(config, version);
  auto server =
      EventServer::listen(loop.value()->handle(), server_options(config), identity, &inherited);
  if (!server) return server.error();
  std::unique_ptr<Daemon> daemon(new Daemon(config, std::move(read_again), log,
                                            std::move(loop).value(), std::move(pipeline).value(),
                                            std::move(server).value()));
  if (const Status opened = daemon->open_control(inherited, identity); !opened)
    return opened.error();
  if (const Status added = daemon->add_sources(); !added) return added.error();
  daemon->server_->publish_state(state_now(State::kStarting, ""));
  if (config.memory.lock) daemon->lock_memory();
  log.write(LogLevel::kInfo, "listening",
            {{"socket", event_socket_path(config)},
             {"camera", config.camera.name},
             {"source", daemon->pipeline_->camera_text()}},
            kIdListening);
  daemon->systemd_.tell("READY=1");
  return daemon;
}

Daemon::Daemon(const DaemonConfig& config, ReadConfig read_again, const Log& log,
               std::unique_ptr<EventLoop> loop, std::unique_ptr<Pipeline> pipeline,
               std::unique_ptr<EventServer> server)
    : config_(config),
      read_again_(std::move(read_again)),
      log_(log),
      loop_(std::move(loop)),
      pipeline_(std::move(pipeline)),
      server_(std::move(server)),
      stats_(monotonic_now_ns()),
      patience_with_clients_ns_(kPatienceAtEnd_ns) {}

Daemon::~Daemon() = default;

// All that is mapped now and later; the map is, and its untouched pages come in by this.
void Daemon::lock_memory() {
  if (mlockall(MCL_CURRENT | MCL_FUTURE) == 0) return;
  log_.warning(errno_error("memory.lock: cannot keep the memory in place", errno).message +
               "; raise LimitMEMLOCK= above memory.budget_mib");
}

Status Daemon::open_control(InheritedSockets& inherited, const Identity& identity) {
  RecordingOptions recording;
  recording.camera = identity.camera;
  recording.loopd_version = identity.version;
  recording.boot_id = identity.boot_id;
  recording.thread.cpus = config_.threads.main_cpus;
  auto control = RemoteControl::open(*loop_, control_socket_path(config_), *this,
                                     pipeline_->recording_tap(), recording, log_, inherited);
  if (!control) return control.error();
  control_ = std::move(control).value();
  if (!server_->warning().empty()) log_.warning(server_->warning());
  for (const std::string& socket : inherited.left())
    log_.warning("systemd listens on a socket that nobody serves", {{"socket", socket}});
  return Nothing{};
}

Status Daemon::add_sources() {
  const auto stats_us = [this] {
    return static_cast<std::uint64_t>(config_.events.stats_interval_s * 1e6);
  };
  if (sd_watchdog_enabled(0, &watchdog_us_) > 0) watch_over_camera();
  Status added = loop_->on_signal(SIGTERM, [this] { end_on_signal("SIGTERM"); });
  if (added) added = loop_->on_signal(SIGINT, [this] { end_on_signal("SIGINT"); });
  if (added) added = loop_->on_signal(SIGHUP, [this] { (void)reload(); });
  if (added) added = loop_->on_readable(pipeline_->wake_fd(), [this] { take_from_pipeline(); });
  if (added) added = loop_->every(stats_us, [this] { publish_stats(); });
  if (added && liveness_)
    added = loop_->every([this] { return watchdog_us_ / 4; }, [this] { feed_watchdog(); });
  return added;
}

/// How long nothing may happen depends on the camera's rate.
void Daemon::watch_over_camera() {
  liveness_.emplace(patience_for(config_.camera.fps, watchdog_us_), monotonic_now_ns());
}

Status Daemon::run() {
  while (!ending_) {
    if (const Status started = start_pipeline_when_awaited(); !started) return started;
    if (const Status ran = loop_->run_once(); !ran) return ran;
  }
  return shut_down();
}

Status Daemon::start_pipeline_when_awaited() {
  const auto awaited = static_cast<std::size_t>(config_.camera.wait_for_clients);
  if (pipeline_started_ || server_->clients() < awaited) return Nothing{};
  pipeline_started_ = true;
  if (const Status started = pipeline_->start(); !started) return started;
  // Last, since threads inherit the CPUs and the priority of the one that starts them.
  const ThreadOptions options{.cpus = config_.threads.main_cpus,
                              .priority = config_.threads.main_priority};
  std::vector<Error> shortfalls = configure_this_thread(options);
  if (config_.threads.required && !shortfalls.empty()) return shortfalls.front();
  for (Error& error : pipeline_->thread_shortfalls()) shortfalls.push_back(std::move(error));
  for (const Error& error : shortfalls)
    log_.write(LogLevel::kWarning, error.message, {{"camera", config_.camera.name}}, kIdThreads);
  return Nothing{};
}

void Daemon::take_from_pipeline() {
  pipeline_->drain_wakeups();
  // A notice, and a new map, come after the reports that were handed over before them.
  const std::uint32_t map = pipeline_->map();
  std::vector<Notice> notices;
  while (auto notice = pipeline_->take_notice()) notices.push_back(*std::move(notice));
  while (const ReportQueue::Lent taken = pipeline_->take_report()) publish(*taken);
  follow_map(map);
  for (const Notice& notice : notices) tell(notice);
  if (pipeline_->failure()) ending_ = true;
}

void Daemon::publish(const TakenReport& taken) {
  follow_map(taken.origin.map);
  const auto& [taken_ns, captured_ns, map] = taken.origin;
  Latency latency;
  if (captured_ns) latency.capture_ns = taken_ns - *captured_ns;
  latency.total_ns = monotonic_now_ns() - captured_ns.value_or(taken_ns);
  server_->publish(taken.report, latency);
}

/// Image ids start over with each map, so that clients need a new epoch.
void Daemon::follow_map(std::uint32_t map) {
  if (map <= map_) return;
  map_ = map;
  server_->new_epoch(random_epoch());
  server_->publish_state(state_now(State::kMapReset, "the map was emptied on request"));
  tell_state_again();
}

/// After a state of passing interest: how camera and detector are.
void Daemon::tell_state_again() {
  StateRecord state = state_;
  state.time_ns = monotonic_now_ns();
  server_->publish_state(paused_ ? state_now(State::kPaused, "asked to rest") : state);
}

void Daemon::pause() {
  if (std::exchange(paused_, true)) return;
  pipeline_->pause();
  tell_state_again();
}

void Daemon::resume() {
  if (!std::exchange(paused_, false)) return;
  pipeline_->resume();
  tell_state_again();
}

ControlFields Daemon::status() const {
  const DetectTotals totals = pipeline_->totals();
  return {{"state", std::string(paused_ ? state_name(State::kPaused) : state_name(state_.state))},
          {"paused", paused_},
          {"source", config_.camera.source},
          {"path", config_.camera.path},
          {"frames", static_cast<std::int64_t>(totals.frames)},
          {"dropped", static_cast<std::int64_t>(pipeline_->dropped_frames())},
          {"loops", static_cast<std::int64_t>(totals.loops)},
          {"images", static_cast<std::int64_t>(totals.images)},
          {"bytes", static_cast<std::int64_t>(totals.bytes)},
          {"clients", static_cast<std::int64_t>(server_->clients())}};
}

void Daemon::tell(const Notice& notice) {
  const auto [what, id] = title_of(notice);
  log_.write(notice.level, what,
             {{"camera", config_.camera.name},
              {"cause", notice.record.cause},
              {"fault", notice.record.fault}},
             id);
  if (!notice.is_state()) return;
  state_ = notice.record;
  server_->publish_state(notice.record);
  if (notice.record.state == State::kCameraEnd && config_.camera.exit_at_end) ending_ = true;
}

void Daemon::publish_stats() {
  const StatsRecord record = stats_.record(*pipeline_, monotonic_now_ns());
  server_->publish_stats(record);
  systemd_.tell("STATUS=" + status_text(record, server_->clients()));
  const std::uint64_t dropped = pipeline_->dropped_reports();
  if (dropped > std::exchange(dropped_reports_told_, dropped))
    log_.write(LogLevel::kWarning,
               "reports dropped on their way to the socket; raise events.report_queue",
               {{"camera", config_.camera.name}, {"since_start", std::to_string(dropped)}},
               kIdReportsDropped);
}

void Daemon::feed_watchdog() {
  const DetectTotals totals = pipeline_->totals();
  const Vitals vitals{.frames_detected = totals.frames,
                      .errors_in_row = totals.errors_in_row,
                      .work_pending = pipeline_->work_pending(),
                      .nothing_to_do = pipeline_->capture().away || paused_ || !pipeline_started_,
                      .camera_answers = pipeline_->capture().answers,
                      .camera_owes_answers = pipeline_started_ && !pipeline_->capture().ended};
  if (liveness_->alive(vitals, monotonic_now_ns())) systemd_.tell("WATCHDOG=1");
}

/// Reads the config again and takes over what can change while running; a config with a mistake
/// changes nothing.
Result<std::string> Daemon::reload() {
  if (ending_) return Error{"the daemon is ending", ESHUTDOWN};
  systemd_.tell("RELOADING=1");
  const LoadedConfig loaded = read_again_();
  Result<std::string> done = loaded.ok() ? take_over(loaded.config) : mistakes_error(loaded);
  log_.write(
      done ? LogLevel::kNotice : LogLevel::kError, "reload",
      {{"camera", config_.camera.name}, {"result", done ? done.value() : done.error().message}},
      kIdReload);
  systemd_.tell("READY=1");
  return done;
}

Result<std::string> Daemon::take_over(const DaemonConfig& wanted) {
  const ConfigChanges changes = changes_between(config_, wanted);
  if (const auto violations = validate(changes.config); !violations.empty())
    return Error{"nothing was taken over, since without a restart it would be wrong: " +
                     violations.front() + "; restart",
                 EINVAL};
  config_ = changes.config;
  if (liveness_) watch_over_camera();
  if (changes.camera.empty()) return changes_text(changes);
  if (const Status replaced = pipeline_->replace_camera(config_.camera); !replaced) {
    broken_ = replaced.error();  // no camera thread: nothing is left but to start anew
    ending_ = true;
    return replaced.error();
  }
  return changes_text(changes);
}

void Daemon::end_on_signal(const char* name) {
  log_.write(LogLevel::kNotice, "ending", {{"signal", name}, {"camera", config_.camera.name}},
             kIdEnding);
  patience_with_clients_ns_ = kPatienceAtSignal_ns;
  ending_ = true;
}

Status Daemon::shut_down() {
  systemd_.tell("STOPPING=1");
  pipeline_->stop();
  take_from_pipeline();
  publish_stats();
  server_->publish_state(state_now(State::kShuttingDown, ""));
  const Status sent = send_what_is_queued();
  control_->end_recording();  // last, since a slow disk takes its time
  control_.reset();
  server_.reset();
  if (broken_) return *broken_;
  if (const std::optional<std::string> failure = pipeline_->failure()) return Error{*failure, 0};
  return sent;
}

/// Goes on serving until the clients have taken what is queued for them, or for as long as there is
/// patience, which a signal cuts short.
Status Daemon::send_what_is_queued() {
  const std::int64_t began_ns = monotonic_now_ns();
  while (server_->queued_bytes() > 0) {
    const std::int64_t left_ns = began_ns + patience_with_clients_ns_ - monotonic_now_ns();
    if (left_ns <= 0) break;
    const Status ran = loop_->run_once(static_cast<std::uint64_t>(left_ns / 1000));
    if (!ran) return ran;
  }
  return Nothing{};
}

}  // namespace loopd
