#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/recording_format.h"
#include "loopd/frame.h"

namespace loopd::testing {

/// One frame with what a recording keeps of it.
struct Shot {
  int width = 0;
  int height = 0;
  std::uint64_t sequence = 0;
  std::optional<std::int64_t> time_ns = {};
  std::vector<std::uint8_t> luma = {};

  LumaView view() const { return {luma.data(), width, height, width}; }
  bool operator==(const Shot&) const = default;
};

/// Pixels that differ from shot to shot and from place to place.
inline Shot make_shot(int width, int height, std::uint64_t sequence,
                      std::optional<std::int64_t> time_ns) {
  Shot shot{width, height, sequence, time_ns, {}};
  for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(width * height); ++i)
    shot.luma.push_back(static_cast<std::uint8_t>((i * 7 + sequence % 251 * 31) % 251));
  return shot;
}

/// A recording made in memory, frame by frame.
class RecordingBytes {
 public:
  explicit RecordingBytes(const RecordingInfo& info = {.camera = "front"}) {
    append(encode_recording_info(info));
  }

  void add(const Shot& shot) {
    add({.number = starts.size(),
         .sequence = shot.sequence,
         .time_ns = shot.time_ns,
         .size = {shot.width, shot.height},
         .pixels_crc = recording_crc(shot.luma)},
        shot.luma);
  }

  /// A header of any content before any pixels.
  void add(const RecordedFrame& frame, std::span<const std::uint8_t> luma) {
    starts.push_back(bytes.size());
    append(encode_recorded_frame(frame));
    append(luma);
    bytes.resize((bytes.size() + 63) / 64 * 64);
  }

  std::string bytes;
  std::vector<std::size_t> starts;  ///< where the frame headers are

 private:
  void append(std::span<const std::uint8_t> more) {
    bytes.append(reinterpret_cast<const char*>(more.data()), more.size());
  }
};

}  // namespace loopd::testing
