// A detector for a very long time in a small budget, on features without images: the time of a
// frame and the memory of the process must not change once the map is full.
//   bench_long_life FRAMES BUDGET_MIB POINTS [ROUTE_FRAMES]     e.g. bench_long_life 1000000 64 200
// Prints a line for each hundredth of the frames: frames, images, mean and p99 ms, RssAnon and
// RssFile in KiB. Exit status 1 if time or memory grew: p99 of the last tenth above 1.1 times that
// of the first tenth after the map was full, RssAnon by more than 1 %, or more than budget + 32
// MiB.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "base/lanes.h"
#include "loopd/detector.h"
#include "support/feature_walk.h"

namespace {

using namespace loopd;

long status_kib(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (word == key + ":") {
      long kib = 0;
      status >> kib;
      return kib;
    }
  return 0;
}

double p99(std::vector<float> ms) {
  const auto at = ms.begin() + static_cast<std::ptrdiff_t>(ms.size() * 99 / 100);
  std::nth_element(ms.begin(), at, ms.end());
  return *at;
}

double mean(const std::vector<float>& ms) {
  double sum = 0;
  for (const float value : ms) sum += value;
  return sum / static_cast<double>(ms.size());
}

struct Sample {
  std::uint64_t frame = 0;
  long anonymous_kib = 0;
  bool full = false;  // something was evicted by then
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "usage: bench_long_life FRAMES BUDGET_MIB POINTS [ROUTE_FRAMES]\n");
    return 2;
  }
  const auto frames = std::strtoull(argv[1], nullptr, 10);
  const auto budget_mib = std::strtol(argv[2], nullptr, 10);
  const auto points = static_cast<std::uint32_t>(std::strtoul(argv[3], nullptr, 10));
  const auto route_frames = argc > 4 ? std::strtoull(argv[4], nullptr, 10) : 20'000;
  if (frames < 1000 || budget_mib < 1 || points < 10 || route_frames < 10) return 2;

  const FeatureWalk route({.route_landmarks = route_frames * (points / 10),
                           .points = points,
                           .lines = points / 5,
                           .step = points / 10,
                           .wander = points / 20});
  Config config;
  config.features.points = static_cast<int>(points);
  config.features.lines = static_cast<int>(points / 5);
  config.memory_budget_bytes = static_cast<std::int64_t>(budget_mib) << 20;
  for (const std::string& text : validate(config)) {
    std::fprintf(stderr, "%s\n", text.c_str());
    return 2;
  }
  auto lanes = TwoLanes::start({.name = "lines"});
  if (!lanes) return 2;
  Detector detector(config, lanes.value().get());
  const auto report = std::make_unique<Report>();
  Features features;
  std::vector<std::vector<float>> ms(100);
  std::vector<Sample> samples;
  std::uint64_t loops = 0;
  std::size_t full_at = 100;  // hundredth in which the map was full from its start
  for (auto& part : ms) part.reserve(frames / 100 + 1);
  std::printf("%10s %8s %9s %9s %9s %9s %9s\n", "frames", "images", "mean ms", "p99 ms", "anon KiB",
              "file KiB", "loops");
  for (std::size_t part = 0; part < 100; ++part) {
    if (full_at == 100 && report->evictions != Evictions{}) full_at = part;
    for (std::uint64_t i = frames * part / 100; i < frames * (part + 1) / 100; ++i) {
      route.see(i, features);
      detector.process(features, i, std::nullopt, *report);
      detector.absorb(*report);
      ms[part].push_back(static_cast<float>(report->times.total_ns) / 1e6F);
      loops += report->outcome == Outcome::kLoop ? 1 : 0;
    }
    samples.push_back({frames * (part + 1) / 100, status_kib("RssAnon"), full_at < 100});
    std::printf("%10llu %8zu %9.3f %9.3f %9ld %9ld %9llu\n",
                static_cast<unsigned long long>(samples.back().frame), report->images,
                mean(ms[part]), p99(ms[part]), samples.back().anonymous_kib, status_kib("RssFile"),
                static_cast<unsigned long long>(loops));
    std::fflush(stdout);
  }
  if (full_at > 80) {
    std::printf("the map was not full early enough: more frames or a smaller budget\n");
    return 1;
  }
  const auto tenth = [&](std::size_t first) {
    std::vector<float> all;
    for (std::size_t part = first; part < first + 10; ++part)
      all.insert(all.end(), ms[part].begin(), ms[part].end());
    return p99(std::move(all));
  };
  const double before = tenth(full_at), after = tenth(90);
  const long first_kib = samples[full_at].anonymous_kib, last_kib = samples.back().anonymous_kib;
  std::printf("full from frame %llu on; p99 %.3f ms then, %.3f ms at the end: %.3f\n",
              static_cast<unsigned long long>(frames * full_at / 100), before, after,
              after / before);
  std::printf("RssAnon %ld KiB then, %ld at the end: %+.2f %%; budget + 32 MiB = %ld\n", first_kib,
              last_kib,
              100.0 * static_cast<double>(last_kib - first_kib) / static_cast<double>(first_kib),
              (budget_mib + 32) * 1024);
  const bool steady = after <= 1.1 * before && last_kib <= first_kib + first_kib / 100 &&
                      last_kib <= (budget_mib + 32) * 1024;
  return steady ? 0 : 1;
}
