#include "loopctl/doctor.h"

#include <sys/resource.h>
#include <sys/sysinfo.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <fstream>
#include <sstream>
#include <utility>

#include "capture/libcamera_driver.h"
#include "capture/v4l2_sysfs.h"
#include "loopctl/doctor_access.h"
#include "loopctl/doctor_camera.h"
#include "loopctl/doctor_config.h"
#include "loopctl/doctor_daemon.h"
#include "loopctl/doctor_threads.h"
#include "loopctl/doctor_trial.h"
#include "loopctl/doctor_unit.h"

namespace loopd::loopctl {

namespace {

std::string content(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

std::uint64_t machine_bytes() {
  struct sysinfo info {};
  return sysinfo(&info) == 0 ? std::uint64_t{info.totalram} * info.mem_unit : 0;
}

/// LimitRTPRIO= of the unit; without one, what this user may.
CpuLimits cpu_limits(const UnitProperties& service) {
  CpuLimits limits;
  limits.online = parse_cpu_list(content("/sys/devices/system/cpu/online"));
  limits.isolated = parse_cpu_list(content("/sys/devices/system/cpu/isolated"));
  limits.by_unit = service.installed();
  if (service.installed()) {
    limits.allowed = parse_cpu_list(service.get("AllowedCPUs"));
    if (const auto limit = service.number("LimitRTPRIO"))
      limits.highest_priority = static_cast<int>(std::min<std::uint64_t>(*limit, 99));
    return limits;
  }
  rlimit limit{};
  const bool limited = geteuid() != 0 && getrlimit(RLIMIT_RTPRIO, &limit) == 0;
  if (limited && limit.rlim_cur != RLIM_INFINITY)
    limits.highest_priority = static_cast<int>(std::min<rlim_t>(limit.rlim_cur, 99));
  return limits;
}

/// One visit to the daemon of one camera; what one look finds, later ones use.
class Examination {
 public:
  explicit Examination(const DoctorOptions& options) : options_(options) {}

  Findings run() {
    look_at_settings();
    look_at_service();
    look_at_user();
    if (config_) {
      add(judge_device_classes(content("/proc/devices"), config_->camera.source));
      look_at_camera();
      add(judge_threads(config_->threads, cpu_limits(service_)));
      add({judge_memory(*config_, service_.number("MemoryMax"), machine_bytes())});
    }
    look_at_units();
    look_at_sockets();
    look_at_daemon();
    return std::move(findings_);
  }

 private:
  void add(Findings findings) { append(findings_, std::move(findings)); }

  std::string config_path() const {
    return options_.config.value_or("/etc/loopd/" + options_.name + ".toml");
  }

  void look_at_settings() {
    CheckedConfig checked = check_config(config_path(), options_.name);
    add(std::move(checked.findings));
    config_ = std::move(checked.config);
    socket_path_ =
        config_ ? event_socket_path(*config_) : "/run/loopd/" + options_.name + "/events.sock";
  }

  /// Nothing is told yet: the lines about the unit come after those about the camera.
  void look_at_service() {
    units_ = ask_systemd(options_.name);
    if (*units_) service_ = units_->value().service;
    if (systemd_listens() && !service_.active()) {
      no_daemon_ = {"it does not run, and asking it would start it", ENOENT};
      return;
    }
    Result<Snapshot> asked = ask_status(socket_path_, std::chrono::seconds(2));
    if (asked) {
      daemon_ = std::move(asked).value();
    } else {
      no_daemon_ = asked.error();
    }
  }

  bool systemd_listens() const { return *units_ && units_->value().socket.active(); }

  void look_at_user() {
    if (!service_.installed()) {
      user_ = current_user();
      return;
    }
    const std::string name = service_.get("User").empty() ? "root" : service_.get("User");
    user_ = find_user(name, service_.get("SupplementaryGroups"));
    if (!user_) {
      add({Finding::problem("access", "there is no user " + name + ", as whom the service runs",
                            "sudo systemd-sysusers, or install the package loopd again")});
    } else if (const auto owner = ownership_of(config_path())) {
      add(judge_config_access(config_path(), *owner, *user_));
    }
  }

  void look_at_camera() {
    const CameraConfig& camera = config_->camera;
    if (camera.source == "v4l2") return look_at_v4l2();
    if (camera.source == "file") return look_at_frames();
    look_at_libcamera();
  }

  void look_at_libcamera() {
    const auto listings = list_libcamera_cameras();
    if (!listings) return add({Finding::problem("camera", listings.error().message, "")});
    FoundCamera found = find_libcamera_camera(config_->camera, listings.value());
    add(std::move(found.findings));
    if (!found.listing) return;
    if (!found.listing->modes.empty()) add(judge_modes(config_->camera, found.listing->modes));
    if (daemon_works()) return add({Finding::ok("camera", "the daemon has it")});
    look_at_frames();
  }

  void look_at_v4l2() {
    const CameraConfig& camera = config_->camera;
    const V4l2Paths paths;
    FoundCamera found = find_v4l2_camera(camera, list_v4l2_cameras(), paths);
    add(std::move(found.findings));
    if (!found.listing) return;
    const CameraListing& listing = *found.listing;
    if (user_)
      if (const auto owner = ownership_of(listing.node))
        add({judge_node_access(listing.node, *owner, *user_)});
    if (euidaccess(listing.node.c_str(), R_OK | W_OK) != 0) {
      return add({Finding::skipped("camera", "formats and images, you may not open " + listing.node,
                                   "sudo loopctl doctor " + options_.name)});
    }
    add(judge_modes(camera, listing.modes));
    const long pid = static_cast<long>(service_.number("MainPID").value_or(0));
    JudgedUse use = judge_use(
        listing.node, {listing.problem, node_users(paths, listing.node), pid, daemon_works()});
    add(std::move(use.findings));
    if (use.free) look_at_frames();
  }

  void look_at_frames() {
    if (options_.no_trial) return add({Finding::skipped("trial", "not wanted")});
    const Result<Trial> trial = try_camera(config_->camera);
    if (!trial) return add({Finding::problem("trial", trial.error().message, "")});
    add(judge_trial(trial.value(), config_->camera));
  }

  bool daemon_works() const {
    const std::string state = daemon_ ? text_of(daemon_->state, "state") : std::string();
    return state == "running" || state == "camera_back" || state == "map_reset" ||
           state == "paused";
  }

  void look_at_units() {
    if (!*units_) {
      add({Finding::skipped("unit", units_->error().message)});
    } else {
      add(judge_units(options_.name, units_->value(), config_ ? config_->camera.source : "v4l2"));
    }
  }

  void look_at_sockets() {
    const std::string control =
        config_ ? control_socket_path(*config_) : "/run/loopd/" + options_.name + "/control.sock";
    add(judge_socket_file(
        {socket_path_, false, daemon_ || systemd_listens(), ownership_of(socket_path_)}));
    add(judge_socket_file({control, true, daemon_.has_value(), ownership_of(control)}));
  }

  void look_at_daemon() {
    if (daemon_) return add(judge_daemon(*daemon_, LOOPD_VERSION));
    const bool absent = no_daemon_.code == ENOENT || no_daemon_.code == ECONNREFUSED;
    if (absent && !service_.active()) return add({Finding::skipped("daemon", no_daemon_.message)});
    add({Finding::problem("daemon", no_daemon_.message,
                          "journalctl -u loopd@" + options_.name +
                              " says what it does; sudo "
                              "systemctl restart loopd@" +
                              options_.name + " starts it anew")});
  }

  const DoctorOptions& options_;
  Findings findings_;
  std::optional<DaemonConfig> config_;
  std::string socket_path_;
  std::optional<Result<CameraUnits>> units_;
  UnitProperties service_;  ///< empty: systemd was not asked
  std::optional<DaemonUser> user_;
  std::optional<Snapshot> daemon_;
  Error no_daemon_;  ///< why it does not answer
};

}  // namespace

Findings examine(const DoctorOptions& options) { return Examination(options).run(); }

int doctor(const DoctorOptions& options, std::ostream& out) {
  const Findings findings = examine(options);
  if (options.json) {
    out << dump(findings_json(findings)) << std::endl;
  } else {
    out << findings_text(findings) << std::flush;
  }
  return out && !has_problem(findings) ? 0 : 1;
}

}  // namespace loopd::loopctl
