#include "loopctl/doctor_unit.h"

#include <charconv>

namespace loopd::loopctl {

namespace {

constexpr const char* kTopic = "unit";

std::string systemctl(const std::string& verb, const std::string& unit) {
  return "sudo systemctl " + verb + " " + unit;
}

Finding judge_boot(const std::string& unit, const UnitProperties& service) {
  const std::string state = service.get("UnitFileState");
  if (state == "enabled" || state == "enabled-runtime")
    return Finding::ok(kTopic, unit + " is started at boot");
  if (state == "masked" || state == "masked-runtime")
    return Finding::problem(kTopic, unit + " is masked, so it cannot be started",
                            systemctl("unmask", unit));
  return Finding::warning(kTopic, unit + " is not started at boot",
                          systemctl("enable --now", unit));
}

Finding judge_activity(const std::string& unit, const UnitProperties& service) {
  const std::string state = service.get("ActiveState");
  const std::string journal = "journalctl -u " + unit + " -n 50 says why";
  if (state == "active") {
    const std::string status = service.get("StatusText");
    return Finding::ok(kTopic, unit + " runs" + (status.empty() ? "" : ": " + status));
  }
  if (state == "failed")
    return Finding::problem(kTopic,
                            unit + " has failed (" + service.get("Result") + ", exit status " +
                                service.get("ExecMainStatus") + ")",
                            journal);
  if (state == "activating")
    return Finding::warning(kTopic, unit + " is starting, or waits to be started again", journal);
  return Finding::warning(kTopic, unit + " does not run", systemctl("start", unit));
}

Findings judge_restarts(const std::string& unit, const UnitProperties& service) {
  const auto restarts = service.number("NRestarts").value_or(0);
  if (restarts == 0) return {};
  return {Finding::warning(kTopic,
                           unit + " was restarted by systemd " + std::to_string(restarts) +
                               (restarts == 1 ? " time" : " times") + " since it was started",
                           "journalctl -u " + unit + " says after what")};
}

/// Whether the sandbox lets a class of devices through.
bool allows(const UnitProperties& service, const std::string& device_class) {
  const std::string policy = service.get("DevicePolicy");
  const std::string allowed = service.get("DeviceAllow");
  if (policy.empty() || (policy == "auto" && allowed.empty())) return true;
  return allowed.find(device_class) != std::string::npos ||
         allowed.find("/dev/") != std::string::npos;  // single nodes, by somebody who knows
}

Findings judge_devices(const std::string& unit, const UnitProperties& service,
                       const std::string& source) {
  Findings findings;
  const auto check = [&](const std::string& device_class) {
    if (allows(service, device_class)) return;
    findings.push_back(Finding::problem(
        kTopic, "the sandbox of " + unit + " lets no " + device_class + " device through",
        "sudo systemctl edit " + unit + ", and add [Service] DeviceAllow=" + device_class + " rw"));
  };
  if (source == "v4l2" || source == "libcamera") check("char-video4linux");
  if (source == "libcamera") check("char-media");
  return findings;
}

Findings judge_socket(const std::string& unit, const UnitProperties& socket) {
  if (!socket.installed()) return {};
  if (socket.active()) return {Finding::ok(kTopic, unit + " listens")};
  return {Finding::warning(
      kTopic, unit + " does not listen, so that clients lose records while the daemon restarts",
      systemctl("enable --now", unit))};
}

}  // namespace

UnitProperties::UnitProperties(std::string_view text) {
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
    const std::size_t equals = line.find('=');
    if (equals == std::string_view::npos) continue;
    std::string& value = values_[std::string(line.substr(0, equals))];
    if (!value.empty()) value += '\n';
    value += line.substr(equals + 1);
  }
}

std::string UnitProperties::get(const std::string& name) const {
  const auto found = values_.find(name);
  return found == values_.end() ? std::string() : found->second;
}

std::optional<std::uint64_t> UnitProperties::number(const std::string& name) const {
  const std::string text = get(name);
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  // The largest 64-bit number is how some versions write "infinity".
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole && value != UINT64_MAX ? std::optional(value) : std::nullopt;
}

Findings judge_units(const std::string& camera, const CameraUnits& units,
                     const std::string& source) {
  const std::string unit = "loopd@" + camera;
  if (!units.service.installed()) {
    return {Finding::warning(kTopic,
                             "the unit loopd@.service is not installed here, so nothing starts or "
                             "restarts the daemon",
                             "install the package loopd")};
  }
  Findings findings = {judge_boot(unit, units.service), judge_activity(unit, units.service)};
  append(findings, judge_restarts(unit, units.service));
  append(findings, judge_devices(unit, units.service, source));
  append(findings, judge_socket(unit + ".socket", units.socket));
  if (units.service.get("NeedDaemonReload") == "yes")
    findings.push_back(Finding::warning(kTopic, "systemd has not read a change of " + unit + " yet",
                                        "sudo systemctl daemon-reload"));
  return findings;
}

}  // namespace loopd::loopctl
