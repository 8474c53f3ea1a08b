#include "loopctl/doctor_config.h"

#include <unistd.h>
#include <array>
#include <cerrno>
#include <sstream>

#include "app/config_file.h"
#include "app/memory_plan.h"

namespace loopd::loopctl {

namespace {

/// The program itself and its libraries, before the first frame, and their buffers while it works.
constexpr std::uint64_t kProcessBytes = std::uint64_t{96} << 20;
/// With fewer images a map covers a room or two.
constexpr std::uint64_t kFewImages = 200;

Finding missing_file(const std::string& path, int code) {
  if (code == EACCES)
    return Finding::problem("config", "may not read " + path, "sudo loopctl doctor");
  return Finding::problem(
      "config", "there is no " + path,
      "loopctl cameras prints what to put into it; loopd --print-config prints every setting");
}

std::string mib_text(std::uint64_t bytes) { return std::to_string(bytes >> 20) + " MiB"; }

bool has_class(const std::string& proc_devices, const std::string& name) {
  std::istringstream lines(proc_devices);
  for (std::string line; std::getline(lines, line);) {
    if (line == "Block devices:") return false;
    std::istringstream words(line);
    std::string number, word;
    if (words >> number >> word && word == name) return true;
  }
  return false;
}

}  // namespace

CheckedConfig check_config(const std::string& path, const std::string& camera) {
  if (access(path.c_str(), R_OK) != 0) return {{missing_file(path, errno)}, std::nullopt};
  const std::array<std::string, 1> sets = {"camera.name=" + camera};
  LoadedConfig loaded = load_config(path, sets);
  for (std::string& missing : missing_for_daemon(loaded.config))
    loaded.mistakes.push_back(std::move(missing));
  Findings findings;
  for (std::string& mistake : loaded.mistakes)
    findings.push_back(Finding::problem("config", std::move(mistake), "man loopd.toml"));
  if (!loaded.ok()) return {std::move(findings), std::nullopt};
  findings.push_back(Finding::ok("config", path + " is valid"));
  return {std::move(findings), std::move(loaded.config)};
}

Findings judge_device_classes(const std::string& proc_devices, const std::string& source) {
  Findings findings;
  const auto check = [&](const std::string& device_class, const std::string& module) {
    if (has_class(proc_devices, device_class)) return;
    findings.push_back(Finding::warning(
        "kernel",
        "the kernel knows no " + device_class +
            " devices yet, so the service cannot be "
            "allowed to use one that is plugged in later",
        "sudo modprobe " + module + ", then start the service anew; the package does so at boot"));
  };
  if (source == "v4l2" || source == "libcamera") check("video4linux", "videodev");
  if (source == "libcamera") check("media", "mc");
  return findings;
}

Finding judge_memory(const DaemonConfig& config, std::optional<std::uint64_t> memory_max,
                     std::uint64_t machine_bytes) {
  const bool by_unit = memory_max && *memory_max < machine_bytes;
  const std::uint64_t limit = by_unit ? *memory_max : machine_bytes;
  const MemoryPlan plan = memory_plan(config);
  const std::uint64_t needed = plan.budget + kProcessBytes;
  const std::string of = mib_text(limit) + (by_unit ? " that the unit allows" : " of this machine");
  const std::string remedy = by_unit
                                 ? "raise MemoryMax= (systemctl edit), or lower memory.budget_mib"
                                 : "lower memory.budget_mib";
  if (limit < needed)
    return Finding::problem("memory",
                            mib_text(needed) +
                                " may be needed, memory.budget_mib and the program " +
                                "itself, more than the " + of,
                            remedy);
  const std::string text = mib_text(needed) + " of the " + of + "; the map has room for " +
                           std::to_string(plan.map.full_images) + " images and more";
  return plan.map.full_images < kFewImages
             ? Finding::warning("memory", text, "raise memory.budget_mib")
             : Finding::ok("memory", text);
}

}  // namespace loopd::loopctl
