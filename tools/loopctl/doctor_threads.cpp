#include "loopctl/doctor_threads.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <vector>

namespace loopd::loopctl {

namespace {

constexpr const char* kTopic = "threads";
constexpr int kMostCpus = 1024;

struct Thread {
  std::string name;
  const std::vector<int>& cpus;
  int priority;
};

std::vector<Thread> threads_of(const ThreadsConfig& config) {
  std::vector<Thread> threads = {{"capture", config.capture_cpus, config.capture_priority},
                                 {"detect", config.detect_cpus, config.detect_priority}};
  if (config.lanes == 2) threads.push_back({"lines", config.lines_cpus, config.lines_priority});
  threads.push_back({"main", config.main_cpus, config.main_priority});
  return threads;
}

std::string cpus_text(const auto& cpus) {
  std::string text;
  for (const int cpu : cpus) text += (text.empty() ? "" : ",") + std::to_string(cpu);
  return text;
}

std::vector<int> outside(const std::vector<int>& cpus, const std::set<int>& set) {
  std::vector<int> missing;
  std::ranges::copy_if(cpus, std::back_inserter(missing),
                       [&](int cpu) { return !set.contains(cpu); });
  return missing;
}

/// Whatever costs a thread what it is to have: the daemon goes on without, unless told not to.
Finding shortfall(bool required, std::string text, std::string remedy) {
  return required ? Finding::problem(kTopic, std::move(text), std::move(remedy))
                  : Finding::warning(kTopic, std::move(text), std::move(remedy));
}

Findings judge_cpus(const Thread& thread, const CpuLimits& limits, bool required) {
  const std::string key = "threads." + thread.name + "_cpus";
  Findings findings;
  if (const auto missing = outside(thread.cpus, limits.online); !missing.empty()) {
    findings.push_back(shortfall(
        required, key + " names CPU " + cpus_text(missing) + ", which is not there or is off",
        "CPUs here: " + cpus_text(limits.online)));
  } else if (const auto barred = outside(thread.cpus, limits.allowed);
             !limits.allowed.empty() && !barred.empty()) {
    findings.push_back(shortfall(
        required, key + " names CPU " + cpus_text(barred) + ", which AllowedCPUs= of the unit bars",
        "allowed: " + cpus_text(limits.allowed)));
  }
  const auto not_isolated = outside(thread.cpus, limits.isolated);
  if (thread.cpus.size() > 1 && not_isolated.empty()) {
    findings.push_back(Finding::warning(
        kTopic, key + " names several isolated CPUs, but there the kernel uses only the first",
        "give one CPU"));
  }
  return findings;
}

Findings judge_priority(const Thread& thread, const CpuLimits& limits, bool required) {
  if (!limits.highest_priority || thread.priority <= *limits.highest_priority) return {};
  const std::string remedy =
      limits.by_unit
          ? "LimitRTPRIO=" + std::to_string(thread.priority) + " in the unit (sudo systemctl edit)"
          : "run the daemon as a service, or as root; or raise rtprio in "
            "/etc/security/limits.conf";
  return {shortfall(required,
                    "threads." + thread.name + "_priority = " + std::to_string(thread.priority) +
                        " is more than allowed (" + std::to_string(*limits.highest_priority) + ")",
                    remedy)};
}

Findings judge_lanes(const ThreadsConfig& config) {
  if (config.lanes != 2 || config.detect_cpus.size() != 1 ||
      config.detect_cpus != config.lines_cpus)
    return {};
  return {Finding::warning(kTopic,
                           "points and lines share CPU " + cpus_text(config.detect_cpus) +
                               ", so they wait for each other",
                           "give threads.lines_cpus another CPU, or set threads.lanes = 1")};
}

/// Isolated CPUs were set aside for something: perhaps for this.
Findings hint_isolated(const std::vector<Thread>& threads, const std::set<int>& isolated) {
  const bool used = std::ranges::any_of(threads, [&](const Thread& thread) {
    return std::ranges::any_of(thread.cpus, [&](int cpu) { return isolated.contains(cpu); });
  });
  if (isolated.empty() || used) return {};
  return {Finding::ok(kTopic, "CPU " + cpus_text(isolated) +
                                  " is isolated and not used by loopd; if it was meant for it, "
                                  "name it in threads.detect_cpus")};
}

std::string described(const std::vector<Thread>& threads) {
  std::string text;
  for (const Thread& thread : threads) {
    text += (text.empty() ? "" : ", ") + thread.name + " on " +
            (thread.cpus.empty() ? "any CPU" : "CPU " + cpus_text(thread.cpus));
    if (thread.priority > 0) text += " with priority " + std::to_string(thread.priority);
  }
  return text;
}

}  // namespace

std::set<int> parse_cpu_list(std::string_view text) {
  std::set<int> cpus;
  const char* at = text.data();
  const char* const end = at + text.size();
  const auto number = [&](int& value) {
    const auto [next, error] = std::from_chars(at, end, value);
    at = next;
    return error == std::errc() && value >= 0 && value < kMostCpus;
  };
  while (at != end) {
    int first = 0;
    if (!number(first)) break;
    int last = first;
    if (at != end && *at == '-' && (++at, !number(last))) break;
    for (int cpu = first; cpu <= last; ++cpu) cpus.insert(cpu);
    while (at != end && (*at == ',' || *at == ' ')) ++at;
  }
  return cpus;
}

Findings judge_threads(const ThreadsConfig& config, const CpuLimits& limits) {
  const std::vector<Thread> threads = threads_of(config);
  Findings findings;
  for (const Thread& thread : threads) {
    append(findings, judge_cpus(thread, limits, config.required));
    append(findings, judge_priority(thread, limits, config.required));
  }
  append(findings, judge_lanes(config));
  if (findings.empty()) findings.push_back(Finding::ok(kTopic, described(threads)));
  append(findings, hint_isolated(threads, limits.isolated));
  return findings;
}

}  // namespace loopd::loopctl
