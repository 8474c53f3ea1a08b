// The capture path without the detector: what a frame costs, and whether every frame that did not
// come is counted.
//   bench_capture SECONDS KEY=VALUE...     e.g. bench_capture 10 camera.path=FOLDER camera.fps=1000
//   camera.loop=true
// Exit status 1 if frames are missing that no counter shows.
#include <time.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include "app/camera_factory.h"
#include "app/capture_loop.h"
#include "app/config_file.h"
#include "base/thread.h"

namespace {

using namespace loopd;

std::int64_t thread_cpu_ns() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

/// What the frames' own numbers say.
struct Span {
  std::uint64_t first = 0;
  std::uint64_t last = 0;
  std::uint64_t taken = 0;

  void add(std::uint64_t sequence) {
    if (taken++ == 0) first = sequence;
    last = sequence;
  }
  std::uint64_t numbers() const { return taken == 0 ? 0 : last - first + 1; }
};

int measure(double seconds, const DaemonConfig& config) {
  FramePool pool(static_cast<std::size_t>(config.camera.buffers),
                 static_cast<std::size_t>(config.camera.max_pixels));
  auto camera = open_camera(config.camera, pool);
  if (!camera) {
    std::fprintf(stderr, "bench_capture: %s\n", camera.error().message.c_str());
    return 2;
  }
  auto wakeup = Wakeup::make();
  Mailbox<Frame> mailbox;
  RecordingTap tap;
  NoticeQueue notices;
  CaptureCounters counters;
  CaptureLoop loop(mailbox, tap, notices, wakeup.value(), counters, config.camera.lock_step());
  std::int64_t cpu_ns = 0;
  const auto body = [&] {
    loop.run(*camera.value());
    cpu_ns = thread_cpu_ns();
    mailbox.close();
  };
  auto thread = NamedThread::start({.name = "capture"}, body, [](const auto&, const auto&) {});
  if (!thread) {
    std::fprintf(stderr, "bench_capture: %s\n", thread.error().message.c_str());
    return 2;
  }
  std::thread stopper([&] {
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    camera.value()->interrupt();
  });
  Span span;
  while (const std::optional<Frame> frame = mailbox.take()) span.add(frame->sequence);
  stopper.join();
  thread.value().join();

  const std::uint64_t delivered = counters.frames;
  const std::uint64_t dropped = camera.value()->dropped();
  const std::uint64_t overwritten = mailbox.overwritten();
  const std::uint64_t counted = span.taken + overwritten + dropped + counters.corrupt;
  // Frames before the first that was taken, and after the last, have no number here.
  const bool complete = counted >= span.numbers() && delivered == span.taken + overwritten;
  std::printf(
      "frames delivered %llu (%.1f/s), taken %llu, overwritten %llu, dropped %llu, corrupt %llu, "
      "restamped %llu, losses %llu\nnumbers %llu, counted %llu: %s\ncapture thread: %.1f us of CPU "
      "a frame\n",
      static_cast<unsigned long long>(delivered), static_cast<double>(delivered) / seconds,
      static_cast<unsigned long long>(span.taken), static_cast<unsigned long long>(overwritten),
      static_cast<unsigned long long>(dropped),
      static_cast<unsigned long long>(counters.corrupt.load()),
      static_cast<unsigned long long>(camera.value()->restamped()),
      static_cast<unsigned long long>(counters.losses.load()),
      static_cast<unsigned long long>(span.numbers()), static_cast<unsigned long long>(counted),
      complete ? "none missing" : "MISSING",
      delivered > 0 ? static_cast<double>(cpu_ns) / 1e3 / static_cast<double>(delivered) : 0.0);
  return complete ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  const double seconds = argc > 1 ? std::atof(argv[1]) : 0;
  const std::vector<std::string> sets(argv + std::min(argc, 2), argv + argc);
  LoadedConfig loaded = load_config(std::nullopt, sets);
  for (const std::string& mistake : loaded.mistakes)
    std::fprintf(stderr, "bench_capture: %s\n", mistake.c_str());
  if (seconds <= 0 || !loaded.ok()) {
    std::fprintf(stderr, "usage: bench_capture SECONDS KEY=VALUE...\n");
    return 2;
  }
  return measure(seconds, loaded.config);
}
