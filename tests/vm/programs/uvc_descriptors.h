#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace loopd::vm {

struct FrameSize {
  int width_px = 0;
  int height_px = 0;
};

/// What kind of USB camera this is.
struct UvcModel {
  std::uint16_t vendor = 0x1209;  // pid.codes' number for tests
  std::uint16_t product = 0x0001;
  std::string name = "Virtual Camera";
  std::string serial = "SN0001";
  std::vector<FrameSize> sizes{};  ///< of both formats; not empty, at most 15
  double fps = 30;                 ///< and half of it
};

/// Numbers by which host and device speak of formats and parts.
constexpr std::uint8_t kFormatYuyv = 1;
constexpr std::uint8_t kFormatMjpeg = 2;
constexpr std::uint8_t kStreamingInterface = 1;
constexpr std::uint8_t kStreamEndpoint = 1;

/// Frame interval in the unit of UVC, 100 ns.
std::uint32_t frame_interval(double fps);

/// Descriptors as USB 2.0 and UVC 1.0 define them: two interfaces, one camera terminal to one USB
/// terminal, YUYV and MJPG over a bulk endpoint. Thread-safe.
std::vector<std::uint8_t> device_descriptor(const UvcModel& model);
std::vector<std::uint8_t> configuration_descriptor(const UvcModel& model);
/// 0: the languages; 1: maker; 2: name; 3: serial number; empty for any other.
std::vector<std::uint8_t> string_descriptor(const UvcModel& model, unsigned index);

}  // namespace loopd::vm
