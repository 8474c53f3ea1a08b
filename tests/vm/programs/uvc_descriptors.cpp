#include "uvc_descriptors.h"

#include <array>

namespace loopd::vm {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint8_t kConfiguration = 2;
constexpr std::uint8_t kString = 3;
constexpr std::uint8_t kInterface = 4;
constexpr std::uint8_t kEndpoint = 5;
constexpr std::uint8_t kAssociation = 11;
constexpr std::uint8_t kClassSpecific = 0x24;
constexpr std::uint8_t kVideoClass = 0x0e;
constexpr std::uint8_t kControlSubclass = 1;
constexpr std::uint8_t kStreamingSubclass = 2;
constexpr std::uint8_t kCameraTerminal = 1;
constexpr std::uint8_t kUsbTerminal = 2;
constexpr std::uint8_t kBulkIn = 0x80 | kStreamEndpoint;
constexpr std::uint16_t kPacketBytes = 512;
constexpr std::uint32_t kClockHz = 48'000'000;
constexpr std::array<std::uint8_t, 16> kYuy2Guid = {'Y',  'U', 'Y', '2',  0, 0,    0x10, 0,
                                                    0x80, 0,   0,   0xaa, 0, 0x38, 0x9b, 0x71};

void put(Bytes& to, std::initializer_list<int> bytes) {
  for (const int byte : bytes) to.push_back(static_cast<std::uint8_t>(byte));
}
void put16(Bytes& to, unsigned value) {
  put(to, {static_cast<int>(value & 0xff), static_cast<int>(value >> 8 & 0xff)});
}
void put32(Bytes& to, std::uint32_t value) {
  put16(to, value & 0xffff);
  put16(to, value >> 16);
}
void append(Bytes& to, const Bytes& more) { to.insert(to.end(), more.begin(), more.end()); }

/// A descriptor from what follows its length byte.
Bytes descriptor(const Bytes& rest) {
  Bytes all;
  all.reserve(rest.size() + 1);
  put(all, {static_cast<int>(rest.size() + 1)});
  append(all, rest);
  return all;
}

/// Joins `head`, the total length of itself and `tail`, `rest_of_head`, and `tail`.
Bytes with_total_length(const Bytes& head, const Bytes& rest_of_head, const Bytes& tail) {
  const std::size_t length = 1 + head.size() + 2 + rest_of_head.size();
  Bytes all;
  all.reserve(length + tail.size());
  put(all, {static_cast<int>(length)});
  append(all, head);
  put16(all, static_cast<unsigned>(length + tail.size()));
  append(all, rest_of_head);
  append(all, tail);
  return all;
}

Bytes frame_descriptor(bool mjpeg, int index, FrameSize size, double fps) {
  const auto width = static_cast<unsigned>(size.width_px);
  const auto height = static_cast<unsigned>(size.height_px);
  const std::uint32_t bytes = width * height * 2;
  Bytes d{kClassSpecific, static_cast<std::uint8_t>(mjpeg ? 7 : 5),
          static_cast<std::uint8_t>(index), 0};
  put16(d, width);
  put16(d, height);
  put32(d, static_cast<std::uint32_t>(bytes * 8 * fps / 2));
  put32(d, static_cast<std::uint32_t>(bytes * 8 * fps));
  put32(d, bytes);
  put32(d, frame_interval(fps));
  put(d, {2});
  put32(d, frame_interval(fps));
  put32(d, frame_interval(fps / 2));
  return descriptor(d);
}

Bytes format_descriptor(bool mjpeg, std::size_t frames) {
  Bytes d{kClassSpecific, static_cast<std::uint8_t>(mjpeg ? 6 : 4),
          mjpeg ? kFormatMjpeg : kFormatYuyv, static_cast<std::uint8_t>(frames)};
  if (mjpeg) {
    put(d, {0});  // samples differ in size
  } else {
    d.insert(d.end(), kYuy2Guid.begin(), kYuy2Guid.end());
    put(d, {16});  // bits a pixel
  }
  put(d, {1, 0, 0, 0, 0});  // default frame, aspect ratio, interlacing, copy protection
  return descriptor(d);
}

Bytes stream_formats(const UvcModel& model) {
  Bytes formats;
  for (const bool mjpeg : {false, true}) {
    append(formats, format_descriptor(mjpeg, model.sizes.size()));
    int index = 0;
    for (const FrameSize size : model.sizes) {
      append(formats, frame_descriptor(mjpeg, ++index, size, model.fps));
    }
  }
  return with_total_length(
      {kClassSpecific, 1, 2},
      {kBulkIn, 0, kUsbTerminal, 0, 0, 0, 1, 0, 0},  // no still images, no controls by format
      formats);
}

Bytes interface_descriptor(std::uint8_t number, std::uint8_t endpoints, std::uint8_t subclass) {
  return descriptor({kInterface, number, 0, endpoints, kVideoClass, subclass, 0, 2});
}

Bytes video_control() {
  Bytes terminals = descriptor(
      {kClassSpecific, 2, kCameraTerminal, 0x01, 0x02, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0});
  append(terminals,
         descriptor({kClassSpecific, 3, kUsbTerminal, 0x01, 0x01, 0, kCameraTerminal, 0}));
  Bytes clock;
  put32(clock, kClockHz);
  put(clock, {1, kStreamingInterface});
  return with_total_length({kClassSpecific, 1, 0x00, 0x01}, clock, terminals);
}

}  // namespace

std::uint32_t frame_interval(double fps) { return static_cast<std::uint32_t>(1e7 / fps + 0.5); }

Bytes device_descriptor(const UvcModel& model) {
  Bytes d{1, 0x00, 0x02, 0xef, 2, 1, 64};  // USB 2.0; interfaces belong together
  put16(d, model.vendor);
  put16(d, model.product);
  put(d, {0x00, 0x01, 1, 2, 3, 1});
  return descriptor(d);
}

Bytes configuration_descriptor(const UvcModel& model) {
  Bytes parts = descriptor({kAssociation, 0, 2, kVideoClass, 3, 0, 2});
  append(parts, interface_descriptor(0, 0, kControlSubclass));
  append(parts, video_control());
  append(parts, interface_descriptor(kStreamingInterface, 1, kStreamingSubclass));
  append(parts, stream_formats(model));
  append(parts, descriptor({kEndpoint, kBulkIn, 2, kPacketBytes & 0xff, kPacketBytes >> 8, 0}));
  return with_total_length({kConfiguration}, {2, 1, 0, 0x80, 250}, parts);
}

Bytes string_descriptor(const UvcModel& model, unsigned index) {
  Bytes d{kString};
  if (index == 0) {
    put16(d, 0x0409);
    return descriptor(d);
  }
  if (index > 3) return {};
  const std::array<std::string, 3> texts = {"loopd tests", model.name, model.serial};
  for (const char letter : texts[index - 1]) put(d, {letter, 0});
  return descriptor(d);
}

}  // namespace loopd::vm
