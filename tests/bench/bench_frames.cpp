// Whole frames of a recording, beside cv::ORB(1500) on the same frames in the same run: first one
// frame through the detector, then the same through cv::ORB, and so on, so that both see the same
// machine.
//   bench_frames DATASET [KEY=VALUE...]     e.g. bench_frames kitchen loop.waiting_frames=100
// Prints milliseconds, and JSON with --json FILE as the first two arguments.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <opencv2/features2d.hpp>
#include <string>
#include <vector>

#include "app/camera_factory.h"
#include "app/config_file.h"
#include "app/memory_plan.h"
#include "base/frame_pool.h"
#include "base/lanes.h"
#include "loopd/detector.h"

namespace {

using namespace loopd;
using Clock = std::chrono::steady_clock;

struct Figures {
  double mean = 0, p50 = 0, p99 = 0, max = 0;
};

Figures figures_of(std::vector<double> ms) {
  if (ms.empty()) return {};
  std::sort(ms.begin(), ms.end());
  double sum = 0;
  for (const double value : ms) sum += value;
  const auto at = [&](double share) {
    return ms[std::min(ms.size() - 1,
                       static_cast<std::size_t>(share * static_cast<double>(ms.size())))];
  };
  return {sum / static_cast<double>(ms.size()), at(0.5), at(0.99), ms.back()};
}

/// Milliseconds of each frame, stage by stage.
struct Times {
  std::vector<double> orb, features, search, verify, update, total;

  void add(const StageTimes& t) {
    const auto ms = [](std::int64_t ns) { return static_cast<double>(ns) / 1e6; };
    features.push_back(ms(t.features_ns));
    search.push_back(ms(t.search_ns));
    verify.push_back(ms(t.verify_ns));
    update.push_back(ms(t.update_ns));
    total.push_back(ms(t.total_ns));
  }
};

double orb_ms(cv::ORB& orb, const Frame& frame) {
  const cv::Mat image(frame.height_px, frame.width_px, CV_8UC1, frame.buffer.get(),
                      static_cast<std::size_t>(frame.stride_bytes));
  static std::vector<cv::KeyPoint> keypoints;
  static cv::Mat descriptors;
  const auto start = Clock::now();
  orb.detectAndCompute(image, cv::noArray(), keypoints, descriptors);
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

int measure(const DaemonConfig& config, Times& times) {
  FramePool pool(2, static_cast<std::size_t>(config.camera.max_pixels));
  auto camera = open_camera(config.camera, pool);
  if (!camera) {
    std::fprintf(stderr, "bench_frames: %s\n", camera.error().message.c_str());
    return 2;
  }
  std::unique_ptr<TwoLanes> lanes;
  if (config.threads.lanes == 2) {
    auto started = TwoLanes::start({.name = "lines"});
    if (!started) return 2;
    lanes = std::move(started).value();
  }
  cv::setNumThreads(1);
  const auto orb = cv::ORB::create(1500);
  Detector detector(detector_config(config), lanes.get());
  const auto report = std::make_unique<Report>();
  for (;;) {
    const CameraEvent event = camera.value()->next();
    const auto* frame = std::get_if<Frame>(&event);
    if (frame == nullptr) return times.total.empty() ? 2 : 0;
    detector.process(*frame, *report);
    detector.absorb(*report);
    times.add(report->times);
    times.orb.push_back(orb_ms(*orb, *frame));
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> words(argv + 1, argv + argc);
  std::string json_path;
  if (words.size() >= 2 && words[0] == "--json") {
    json_path = words[1];
    words.erase(words.begin(), words.begin() + 2);
  }
  if (words.empty()) {
    std::fprintf(stderr, "usage: bench_frames [--json FILE] DATASET [KEY=VALUE...]\n");
    return 2;
  }
  words[0] = "camera.path=" + words[0];
  const LoadedConfig loaded = load_config(std::nullopt, words);
  for (const std::string& mistake : loaded.mistakes) std::fprintf(stderr, "%s\n", mistake.c_str());
  if (!loaded.ok()) return 2;
  Times times;
  if (const int failed = measure(loaded.config, times); failed != 0) return failed;

  nlohmann::ordered_json json;
  const double orb_mean = figures_of(times.orb).mean;
  std::printf("%zu frames\n%-10s %8s %8s %8s %8s %10s\n", times.total.size(), "ms", "mean", "p50",
              "p99", "max", "mean/ORB");
  const auto print = [&](const char* name, const std::vector<double>& ms) {
    const Figures f = figures_of(ms);
    std::printf("%-10s %8.2f %8.2f %8.2f %8.2f %10.2f\n", name, f.mean, f.p50, f.p99, f.max,
                f.mean / orb_mean);
    json[name] = {{"mean_ms", f.mean},
                  {"p50_ms", f.p50},
                  {"p99_ms", f.p99},
                  {"max_ms", f.max},
                  {"of_orb", f.mean / orb_mean}};
  };
  print("cv::ORB", times.orb);
  print("features", times.features);
  print("search", times.search);
  print("verify", times.verify);
  print("update", times.update);
  print("total", times.total);
  std::printf("p99 of total / mean of cv::ORB: %.2f\n", figures_of(times.total).p99 / orb_mean);
  const auto quarter = static_cast<std::ptrdiff_t>(times.total.size() / 4);
  const double first = figures_of({times.total.begin(), times.total.begin() + quarter}).mean;
  const double last = figures_of({times.total.end() - quarter, times.total.end()}).mean;
  std::printf("mean of the last quarter / of the first: %.2f\n", first > 0 ? last / first : 0);
  json["frames"] = times.total.size();
  json["last_quarter_of_first"] = first > 0 ? last / first : 0;
  if (!json_path.empty()) std::ofstream(json_path) << json.dump(1) << "\n";
  return 0;
}
