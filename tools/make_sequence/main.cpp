#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iostream>
#include <string>
#include <thread>

#include "make_sequence/sequence.h"

namespace {

using loopd::sequence::ImageFormat;
using loopd::sequence::SequenceOptions;

void add_options(CLI::App& app, SequenceOptions& o) {
  app.add_option("--frames", o.frames, "frames of the walk");
  app.add_option("--parked", o.parked, "frames standing still before the walk");
  app.add_option("--width", o.width_px, "pixels");
  app.add_option("--height", o.height_px, "pixels");
  app.add_option("--fov", o.fov_deg, "horizontal field of view, degrees");
  auto* laps = app.add_option("--laps", o.laps, "times round the loop in --frames steps");
  app.add_option("--step", o.step_m, "metres from frame to frame");
  app.add_option("--loop", o.loop_m, "metres once round, in place of --laps")->excludes(laps);
  app.add_option("--seed", o.seed, "of building, walk and noise");
  app.add_option("--texture", o.texture, "0..1: posters, plates, marks, grain, tiles; lines stay");
  app.add_option("--sameness", o.sameness,
                 "0..1: how alike the legs' bays, lamps, tiles and tones are; 1 = exact copies");
  app.add_option("--noise", o.noise, "sensor noise, standard deviation in grey levels");
  app.add_option("--blur", o.blur_px, "lens blur, standard deviation in pixels");
  app.add_option("--exposure", o.exposure, "amplitude of the slow gain drift, 0..0.9");
  app.add_option("--offset", o.offset_m, "metres to the left (and a turn) on every second lap");
  app.add_flag("--lap-change", o.lap_change, "switch some lamps on every second lap");
  app.add_option("--gap", o.gap, "least index difference of a true pair");
  app.add_option("--dont-care", o.dont_care_m, "metres within which other pairs are don't care");
  app.add_option("--fps", o.fps, "write times.txt at this frame rate; 0 = no times");
  app.add_option("--jpeg-quality", o.jpeg_quality, "1..100");
  app.add_option_function<std::string>(
         "--format",
         [&o](const std::string& name) {
           o.format = name == "png" ? ImageFormat::kPng : ImageFormat::kJpeg;
         },
         "of the images (png if not given)")
      ->check(CLI::IsMember({"png", "jpg"}));
}

/// Reports rendered images on stderr: in place on a terminal, else a line now and then and one at
/// the end. Thread: calls one at a time.
class Progress {
 public:
  void operator()(std::size_t done, std::size_t total) {
    const auto now = std::chrono::steady_clock::now();
    const bool last = done == total;
    if (!last && now - shown_ < (terminal_ ? kRedraw : kLogLine)) return;
    shown_ = now;
    std::fprintf(stderr, "%smake_sequence: %zu of %zu images%s", terminal_ ? "\r" : "", done, total,
                 last || !terminal_ ? "\n" : "");
  }

 private:
  static constexpr std::chrono::milliseconds kRedraw{200};
  static constexpr std::chrono::milliseconds kLogLine{10'000};
  bool terminal_ = isatty(STDERR_FILENO) == 1;
  std::chrono::steady_clock::time_point shown_ = std::chrono::steady_clock::now();
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Renders a walk round an office corridor with exact ground truth.");
  app.option_defaults()->always_capture_default();
  SequenceOptions options;
  std::string out;
  int threads = std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 16);
  app.add_option("--out", out, "folder to write")->required();
  app.add_option("--threads", threads, "rendering threads")->check(CLI::Range(1, 64));
  add_options(app, options);
  CLI11_PARSE(app, argc, argv);
  const auto status = loopd::sequence::write_sequence(options, out, threads, Progress());
  if (!status) {
    std::cerr << "make_sequence: " << status.error().message << '\n';
    return 1;
  }
  return 0;
}
