#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>

#include "capture/camera.h"
#include "capture/decode.h"

namespace loopd {

/// Images by number, for a FileCamera; knows nothing of rates, faults or buffers.
///
/// Use: prepare() of a number never smaller than the one before, then decode() if it gave a size.
/// Thread: one caller at a time.
class FrameSource {
 public:
  using Prepared = std::variant<ImageSize, CameraError, EndOfStream, Interrupted>;

  virtual ~FrameSource() = default;

  /// Gets frame `sequence` as far as its size; with `corrupt` its data is damaged on the way.
  virtual Prepared prepare(std::uint64_t sequence, bool corrupt) = 0;

  /// Writes the prepared frame, rows packed, into `luma`, which holds at least its pixels.
  virtual std::optional<CameraError> decode(std::span<std::uint8_t> luma) = 0;

  /// The recorded time of a frame, without laps: none if none is known.
  virtual std::optional<std::int64_t> time_ns(std::uint64_t sequence) const = 0;

  /// The sequence number that frame `sequence` gets: its own, or for a recording of a camera the
  /// one the camera gave. Known for sure for the prepared frame only.
  virtual std::uint64_t camera_sequence(std::uint64_t sequence) const { return sequence; }

  /// Frames of one lap; 0 if not known.
  virtual std::uint64_t length() const = 0;

  /// "folder of 84 images, the first 512x384".
  virtual std::string describe() const = 0;
};

}  // namespace loopd
