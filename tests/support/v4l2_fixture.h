#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <variant>

#include "capture/v4l2_driver.h"
#include "support/fake_v4l2.h"
#include "support/temp_dir.h"

namespace loopd::testing {

/// A fake kernel with folders of its own for /dev, /sys and /proc, and one camera, video0.
class V4l2Test : public ::testing::Test {
 protected:
  V4l2Test() {
    for (const char* folder : {"dev", "sys/class/video4linux", "proc"})
      std::filesystem::create_directories(dir_ / folder);
    plug_in("video0", "usb1/1-1/1-1:1.0");
  }

  /// A node with its place in /sys; `device` is the path of its device below sys/devices.
  FakeNode& plug_in(const std::string& name, const std::string& device, int index = 0) {
    dir_.write("dev/" + name, "");
    const std::string folder = "sys/devices/" + device;
    dir_.write(folder + "/video4linux/" + name + "/index", std::to_string(index) + "\n");
    const auto link = [&](const std::string& target, const std::string& from) {
      std::error_code exists;
      std::filesystem::create_directory_symlink(dir_ / target, dir_ / from, exists);
    };
    link(folder, folder + "/video4linux/" + name + "/device");
    link(folder + "/video4linux/" + name, "sys/class/video4linux/" + name);
    return kernel_.node(name);
  }

  void make_usb(const std::string& device, const std::string& product, const std::string& serial) {
    const std::string folder = "sys/devices/" + device;
    dir_.write(folder + "/idVendor", "046d\n");
    dir_.write(folder + "/idProduct", product + "\n");
    if (!serial.empty()) dir_.write(folder + "/serial", serial + "\n");
  }

  FakeNode& camera() { return kernel_.node("video0"); }
  std::string path(const std::string& name = "video0") const {
    return (dir_ / "dev" / name).string();
  }

  CaptureDriver::Opened open(V4l2Options options = {}) {
    if (options.camera.empty()) options.camera = path();
    return make_v4l2_driver(options, kernel_, paths_)->open();
  }

  std::unique_ptr<CaptureDevice> opened(const V4l2Options& options = {}) {
    CaptureDriver::Opened result = open(options);
    if (auto* device = std::get_if<std::unique_ptr<CaptureDevice>>(&result))
      return std::move(*device);
    ADD_FAILURE() << std::get<CameraError>(result).message;
    return nullptr;
  }

  CameraError open_error(const V4l2Options& options = {}) {
    CaptureDriver::Opened result = open(options);
    if (auto* error = std::get_if<CameraError>(&result)) {
      EXPECT_TRUE(error->lost);
      return std::move(*error);
    }
    ADD_FAILURE() << "it opened";
    return {};
  }

  TempDir dir_;
  FakeV4l2 kernel_;
  V4l2Paths paths_{(dir_ / "dev").string(), (dir_ / "sys").string(), (dir_ / "proc").string()};
};

}  // namespace loopd::testing
