// v4l2_feeder: shows a folder of images on a V4L2 output device, at a rate. Prints a line an image:
// its CLOCK_MONOTONIC time in nanoseconds and the name of its file.

#include <CLI/CLI.hpp>
#include <cerrno>
#include <ctime>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "base/clock.h"
#include "images.h"
#include "video_output.h"

namespace {

using namespace loopd;
using namespace loopd::vm;

struct Options {
  std::string folder;
  std::string device;
  std::string format = "YUYV";
  double fps = 30;
  int hold = 1;        ///< frames an image is shown for
  bool steps = false;  ///< the next image comes when a line is read from standard input
  int laps = 1;        ///< times through the folder
};

std::size_t fill(const LumaImage& image, const std::string& format, std::span<std::uint8_t> to) {
  if (format == "YUYV") {
    pack_yuyv(image.view(), to);
    return 2 * image.data.size();
  }
  std::copy(image.data.begin(), image.data.end(), to.begin());
  return image.data.size();
}

void wait_until(std::int64_t time_ns) {
  const timespec time{time_ns / 1'000'000'000, time_ns % 1'000'000'000};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) {
  }
}

/// Puts one image into the device `options.hold` times; `next_ns` is when the next frame is due.
Status show(VideoOutput& output, const LumaImage& image, const Options& options,
            std::int64_t& next_ns) {
  for (int i = 0; i < options.hold; ++i) {
    auto buffer = output.next_image();
    if (!buffer) return buffer.error();
    if (buffer.value().size() < image.data.size() * (options.format == "YUYV" ? 2U : 1U)) {
      return Error{"an image is larger than the first, or than the device's buffers"};
    }
    const std::size_t bytes = fill(image, options.format, buffer.value());
    wait_until(next_ns);
    const Status shown = output.show(bytes);
    if (!shown) return shown;
    next_ns += static_cast<std::int64_t>(1e9 / options.fps);
  }
  return Nothing{};
}

Status feed(const Options& options) {
  const auto files = list_files(options.folder, ".pgm");
  if (!files) return files.error();
  std::vector<LumaImage> images;  // all in memory: reading would upset the rate
  for (const auto& file : files.value()) {
    auto image = read_image(file);
    if (!image) return image.error();
    images.push_back(std::move(image).value());
  }
  auto output = VideoOutput::open(options.device, options.format, images.front().width_px,
                                  images.front().height_px);
  if (!output) return output.error();
  std::int64_t next_ns = monotonic_now_ns();
  for (int lap = 0; lap < options.laps; ++lap) {
    for (std::size_t i = 0; i < images.size(); ++i) {
      std::string line;
      if (options.steps && !(lap == 0 && i == 0) && !std::getline(std::cin, line)) return Nothing{};
      std::cout << monotonic_now_ns() << " " << files.value()[i].filename().string() << std::endl;
      const Status shown = show(output.value(), images[i], options, next_ns);
      if (!shown) return shown;
    }
  }
  return Nothing{};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Shows a folder of images (*.pgm) on a V4L2 output device.");
  Options options;
  app.add_option("FOLDER", options.folder, "folder of *.pgm, all of one size")->required();
  app.add_option("--device", options.device, "such as /dev/video1")->required();
  app.add_option("--format", options.format)->check(CLI::IsMember({"YUYV", "GREY"}));
  app.add_option("--fps", options.fps, "frames a second")->check(CLI::Range(0.01, 1000.0));
  app.add_option("--hold", options.hold, "frames an image is shown for")
      ->check(CLI::Range(1, 1000000));
  app.add_option("--laps", options.laps, "times through the folder")->check(CLI::Range(1, 1000000));
  app.add_flag("--steps", options.steps, "go to the next image at each line of standard input");
  CLI11_PARSE(app, argc, argv);
  const Status status = feed(options);
  if (status) return 0;
  std::cerr << "v4l2_feeder: " << status.error().message << "\n";
  return 1;
}
