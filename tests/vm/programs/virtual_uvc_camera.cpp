// virtual_uvc_camera: a USB camera that the kernel's own usbcore and uvcvideo drive, plugged into
// vhci-hcd (modprobe vhci-hcd). It shows the images of a folder and does as it is told on standard
// input, a command a line, each answered by a line "ok" or "error: ..." (or "state ..."):
//
//   serial TEXT | product NUMBER | sizes WxH,WxH   what is plugged in next
//   plug | unplug                                  in and out of the port
//   freeze | thaw                                  no more frames, frames again
//   bad_frame | truncated_frame                    the next frame is that
//   show N | play HOLD                             image N stays; HOLD frames an image from here on
//   state                                          what it is doing
//
// FOLDER holds a folder WIDTHxHEIGHT for each size, with jpeg/*.jpg and pgm/*.pgm in it.

#include <poll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <filesystem>
#include <functional>
#include <iostream>
#include <map>
#include <optional>
#include <string>

#include "base/clock.h"
#include "commands.h"
#include "images.h"
#include "uvc_camera.h"

namespace {

using namespace loopd;
using namespace loopd::vm;
namespace fs = std::filesystem;
using Words = std::vector<std::string>;

/// The pictures that are shown, and which of them is next.
class Show {
 public:
  explicit Show(fs::path folder) : folder_(std::move(folder)) {}

  void stay_at(std::size_t image) {
    image_ = image;
    hold_ = 0;
  }
  void play(int hold) {
    hold_ = hold;
    shown_ = 0;
  }
  std::size_t image() const { return image_; }

  /// Bytes of the present image in `format`, then goes on if it is time to.
  Result<std::vector<std::uint8_t>> next(const StreamFormat& format) {
    const fs::path folder = folder_ / (std::to_string(format.size.width_px) + "x" +
                                       std::to_string(format.size.height_px));
    auto bytes = format.mjpeg ? jpeg(folder / "jpeg") : yuyv(folder / "pgm");
    if (hold_ > 0 && ++shown_ >= hold_) {
      shown_ = 0;
      ++image_;
    }
    return bytes;
  }

 private:
  Result<fs::path> file(const fs::path& folder, const std::string& extension) {
    const auto files = list_files(folder, extension);
    if (!files) return files.error();
    return files.value()[image_ % files.value().size()];
  }
  Result<std::vector<std::uint8_t>> jpeg(const fs::path& folder) {
    const auto path = file(folder, ".jpg");
    if (!path) return path.error();
    return read_bytes(path.value());
  }
  Result<std::vector<std::uint8_t>> yuyv(const fs::path& folder) {
    const auto path = file(folder, ".pgm");
    if (!path) return path.error();
    const auto image = read_image(path.value());
    if (!image) return image.error();
    std::vector<std::uint8_t> bytes(2 * image.value().data.size());
    pack_yuyv(image.value().view(), bytes);
    return bytes;
  }

  const fs::path folder_;
  std::size_t image_ = 0;
  int hold_ = 1;
  int shown_ = 0;
};

Result<std::vector<FrameSize>> parse_sizes(const std::string& text) {
  std::vector<FrameSize> sizes;
  std::istringstream stream(text);
  for (std::string size; std::getline(stream, size, ',');) {
    FrameSize parsed;
    char x = 0;
    std::istringstream one(size);
    if (!(one >> parsed.width_px >> x >> parsed.height_px) || x != 'x' || parsed.width_px < 1 ||
        parsed.height_px < 1) {
      return Error{"\"" + size + "\" is no size such as 640x480"};
    }
    sizes.push_back(parsed);
  }
  if (sizes.empty() || sizes.size() > 15) return Error{"1 to 15 sizes can be had"};
  return sizes;
}

/// The camera, plugged in or not, and its clock.
class Bench {
 public:
  Bench(UvcModel model, fs::path folder, std::string sysfs)
      : model_(std::move(model)),
        show_(std::move(folder)),
        sysfs_(std::move(sysfs)),
        timer_(timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK)) {}

  /// Until standard input ends.
  Status run() {
    CommandReader commands(STDIN_FILENO);
    while (true) {
      std::array<pollfd, 3> fds{{{STDIN_FILENO, POLLIN, 0},
                                 {camera_ ? camera_->fd() : -1, POLLIN, 0},
                                 {timer_.get(), POLLIN, 0}}};
      if (poll(fds.data(), fds.size(), -1) < 0 && errno != EINTR) {
        return errno_error("cannot poll", errno);
      }
      if (fds[1].revents != 0) serve();
      if (fds[2].revents != 0) tick();
      if (fds[0].revents != 0) {
        if (!commands.fill()) return Nothing{};
        while (const auto words = commands.next()) answer(*words);
      }
    }
  }

 private:
  void answer(const Words& words) {
    const Status done = obey(words);
    std::cout << (done ? "ok" : "error: " + done.error().message) << std::endl;
  }

  Status obey(const Words& words) {
    if (words.size() == 1) return obey_word(words[0]);
    if (words.size() != 2) return Error{"a command is one or two words"};
    return obey_pair(words[0], words[1]);
  }

  Status obey_word(const std::string& word) {
    static const std::map<std::string, std::function<Status(Bench&)>> kCommands = {
        {"plug", [](Bench& b) { return b.plug(); }},
        {"unplug", [](Bench& b) { return b.unplug(); }},
        {"freeze", [](Bench& b) { return b.freeze(true); }},
        {"thaw", [](Bench& b) { return b.freeze(false); }},
        {"bad_frame", [](Bench& b) { return b.spoil(FrameFault::kErrorBit); }},
        {"truncated_frame", [](Bench& b) { return b.spoil(FrameFault::kTruncated); }},
        {"state", [](Bench& b) { return b.print_state(); }}};
    const auto command = kCommands.find(word);
    if (command == kCommands.end()) return Error{"no command " + word};
    return command->second(*this);
  }

  Status obey_pair(const std::string& word, const std::string& value) {
    if (word == "serial") {
      model_.serial = value;
      return Nothing{};
    }
    if (word == "sizes") {
      auto sizes = parse_sizes(value);
      if (!sizes) return sizes.error();
      model_.sizes = std::move(sizes).value();
      return Nothing{};
    }
    char* end = nullptr;
    const unsigned long number = std::strtoul(value.c_str(), &end, 0);
    if (*end != '\0' || number > 65535) return Error{value + " is no number of 0 to 65535"};
    if (word == "product") {
      model_.product = static_cast<std::uint16_t>(number);
    } else if (word == "show") {
      show_.stay_at(number);
    } else if (word == "play") {
      show_.play(static_cast<int>(number));
    } else {
      return Error{"no command " + word};
    }
    return Nothing{};
  }

  Status plug() {
    if (camera_) return Error{"it is plugged in"};
    auto port = UsbIpPort::attach(0, sysfs_);
    if (!port) return port.error();
    camera_.emplace(model_, std::move(port).value());
    return Nothing{};
  }
  Status unplug() {
    if (!camera_) return Error{"it is not plugged in"};
    camera_.reset();
    return set_timer(0);
  }
  Status freeze(bool frozen) {
    frozen_ = frozen;
    return Nothing{};
  }
  Status spoil(FrameFault fault) {
    fault_ = fault;
    return Nothing{};
  }
  Status print_state() {
    std::cout << "state plugged=" << camera_.has_value()
              << " wanted=" << (camera_ && camera_->wanted()) << " image=" << show_.image()
              << " sent=" << sent_ << " late=" << late_ << std::endl;
    return Nothing{};
  }

  void complain(const Error& error) {
    std::cerr << "virtual_uvc_camera: " << error.message << std::endl;
  }

  void serve() {
    const auto served = camera_->serve();
    if (!served) complain(served.error());
    if (!served || !served.value()) {
      camera_.reset();
      return;
    }
    const std::int64_t interval_ns = camera_->format().interval_ns;
    if (interval_ns == interval_ns_) return;
    const Status set = set_timer(interval_ns);
    if (!set) complain(set.error());
  }

  /// Ticks every `interval_ns`, from now on; 0 = no more.
  Status set_timer(std::int64_t interval_ns) {
    interval_ns_ = interval_ns;
    const timespec step{interval_ns / 1'000'000'000, interval_ns % 1'000'000'000};
    const itimerspec setting{step, step};
    if (timerfd_settime(timer_.get(), 0, &setting, nullptr) != 0) {
      return errno_error("cannot set the timer", errno);
    }
    return Nothing{};
  }

  /// A frame is due.
  void tick() {
    std::uint64_t ticks = 0;
    if (read(timer_.get(), &ticks, sizeof ticks) != sizeof ticks || !camera_ || frozen_) return;
    if (camera_->sending()) {
      ++late_;  // the host is slow: a real camera would lose this frame, too
      return;
    }
    if (!camera_->wanted()) return;
    const auto bytes = show_.next(camera_->format());
    const Status sent = bytes
                            ? camera_->send(bytes.value(), std::exchange(fault_, FrameFault::kNone))
                            : Status(bytes.error());
    if (!sent) complain(sent.error());
    ++sent_;
  }

  UvcModel model_;
  Show show_;
  const std::string sysfs_;
  UniqueFd timer_;
  std::optional<UvcCamera> camera_;
  std::int64_t interval_ns_ = 0;
  bool frozen_ = false;
  FrameFault fault_ = FrameFault::kNone;
  std::uint64_t sent_ = 0;
  std::uint64_t late_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("A USB camera for the kernel's uvcvideo, by way of vhci-hcd.");
  std::string folder;
  std::string sizes = "640x480,320x240";
  std::string sysfs = "/sys";
  UvcModel model;
  app.add_option("FOLDER", folder, "with WIDTHxHEIGHT/jpeg and WIDTHxHEIGHT/pgm")->required();
  app.add_option("--sizes", sizes, "sizes of both formats");
  app.add_option("--fps", model.fps, "frames a second")->check(CLI::Range(1.0, 240.0));
  app.add_option("--serial", model.serial);
  app.add_option("--product", model.product);
  app.add_option("--sysfs", sysfs, "where sysfs is mounted");
  CLI11_PARSE(app, argc, argv);
  auto parsed = parse_sizes(sizes);
  Status status = Nothing{};
  if (parsed) {
    model.sizes = std::move(parsed).value();
    status = Bench(model, folder, sysfs).run();
  } else {
    status = parsed.error();
  }
  if (status) return 0;
  std::cerr << "virtual_uvc_camera: " << status.error().message << "\n";
  return 1;
}
