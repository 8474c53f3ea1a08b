#include "app/daemon.h"

#include <signal.h>
#include <sys/random.h>
#include <systemd/sd-daemon.h>

#include <array>
#include <fstream>
#include <utility>

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

ServerOptions server_options(const DaemonConfig& config) {
  ServerOptions options;
  options.socket_path = event_socket_path(config);
  options.max_clients = config.events.max_clients;
  options.client_queue_bytes = static_cast<std::size_t>(config.events.client_queue_kib) * 1024;
  options.stalled_client =
      std::chrono::milliseconds(static_cast<std::int64_t>(config.events.stalled_client_s * 1e3));
  return options;
}

StateRecord state_now(State state, std::string cause) {
  return {state, monotonic_now_ns(), std::move(cause), ""};
}

}  // namespace

Result<std::unique_ptr<Daemon>> Daemon::start(const DaemonConfig& config, const Log& log,
                                              const std::string& version) {
  auto loop = EventLoop::make();
  if (!loop) return loop.error();
  auto pipeline = Pipeline::open(config);
  if (!pipeline) return pipeline.error();
  auto server = EventServer::listen(loop.value()->handle(), server_options(config),
                                    identity_of(config, version));
  if (!server) return server.error();
  std::unique_ptr<Daemon> daemon(new Daemon(config, log, std::move(loop).value(),
                                            std::move(pipeline).value(),
                                            std::move(server).value()));
  if (const Status added = daemon->add_sources(); !added) return added.error();
  daemon->server_->publish_state(state_now(State::kStarting, ""));
  log.info("listening", {{"socket", event_socket_path(config)},
                         {"camera", config.camera.name},
                         {"source", daemon->pipeline_->camera_text()}});
  daemon->systemd_.tell("READY=1");
  return daemon;
}

Daemon::Daemon(const DaemonConfig& config, const Log& log, std::unique_ptr<EventLoop> loop,
               std::unique_ptr<Pipeline> pipeline, std::unique_ptr<EventServer> server)
    : config_(config),
      log_(log),
      loop_(std::move(loop)),
      pipeline_(std::move(pipeline)),
      server_(std::move(server)),
      stats_(monotonic_now_ns()),
      patience_with_clients_ns_(kPatienceAtEnd_ns) {}

Daemon::~Daemon() = default;

Status Daemon::add_sources() {
  const auto stats_us = static_cast<std::uint64_t>(config_.events.stats_interval_s * 1e6);
  std::uint64_t watchdog_us = 0;
  if (sd_watchdog_enabled(0, &watchdog_us) > 0)
    liveness_.emplace(patience_for(config_.camera.fps, watchdog_us), monotonic_now_ns());
  Status added = loop_->on_signal(SIGTERM, [this] { end_on_signal("SIGTERM"); });
  if (added) added = loop_->on_signal(SIGINT, [this] { end_on_signal("SIGINT"); });
  if (added)
    added = loop_->on_signal(
        SIGHUP, [this] { log_.notice("SIGHUP ignored: restart to read the config again"); });
  if (added) added = loop_->on_readable(pipeline_->wake_fd(), [this] { take_from_pipeline(); });
  if (added) added = loop_->every(stats_us, [this] { publish_stats(); });
  if (added && liveness_) added = loop_->every(watchdog_us / 4, [this] { feed_watchdog(); });
  return added;
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
  for (const Error& error : shortfalls) log_.warning(error.message);
  return Nothing{};
}

void Daemon::take_from_pipeline() {
  pipeline_->drain_wakeups();
  // A notice comes after the reports that were handed over before it.
  std::vector<Notice> notices;
  while (auto notice = pipeline_->take_notice()) notices.push_back(*std::move(notice));
  while (const ReportQueue::Lent taken = pipeline_->take_report()) publish(*taken);
  for (const Notice& notice : notices) tell(notice);
  if (pipeline_->failure()) ending_ = true;
}

void Daemon::publish(const TakenReport& taken) {
  Latency latency;
  if (taken.captured_ns) latency.capture_ns = taken.taken_ns - *taken.captured_ns;
  latency.total_ns = monotonic_now_ns() - taken.captured_ns.value_or(taken.taken_ns);
  server_->publish(taken.report, latency);
}

void Daemon::tell(const Notice& notice) {
  const std::string_view what = notice.is_state ? state_name(notice.record.state) : "frame lost";
  log_.write(notice.level, what, {{"camera", config_.camera.name}, {"cause", notice.record.cause}});
  if (!notice.is_state) return;
  server_->publish_state(notice.record);
  if (notice.record.state == State::kCameraEnd && config_.camera.exit_at_end) ending_ = true;
}

void Daemon::publish_stats() {
  const StatsRecord record = stats_.record(*pipeline_, monotonic_now_ns());
  server_->publish_stats(record);
  systemd_.tell("STATUS=" + status_text(record, server_->clients()));
  const std::uint64_t dropped = pipeline_->dropped_reports();
  if (dropped > std::exchange(dropped_reports_told_, dropped))
    log_.warning("reports dropped on their way to the socket; raise events.report_queue",
                 {{"since_start", std::to_string(dropped)}});
}

void Daemon::feed_watchdog() {
  const DetectTotals totals = pipeline_->totals();
  const Vitals vitals{.frames_detected = totals.frames,
                      .errors_in_row = totals.errors_in_row,
                      .work_pending = pipeline_->work_pending(),
                      .camera_away = pipeline_->capture().away || !pipeline_started_};
  if (liveness_->alive(vitals, monotonic_now_ns())) systemd_.tell("WATCHDOG=1");
}

void Daemon::end_on_signal(const char* name) {
  log_.notice("ending", {{"signal", name}});
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
  server_.reset();
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
