#include <CLI/CLI.hpp>
#include <algorithm>
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

void show_progress(std::size_t done, std::size_t total) {
  if (done % 20 != 0 && done != total) return;
  std::fprintf(stderr, "\rmake_sequence: %zu of %zu images%s", done, total,
               done == total ? "\n" : "");
}

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
  const auto status = loopd::sequence::write_sequence(options, out, threads, show_progress);
  if (!status) {
    std::cerr << "make_sequence: " << status.error().message << '\n';
    return 1;
  }
  return 0;
}
