#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "capture/capture_device.h"
#include "capture/v4l2_formats.h"
#include "capture/v4l2_io.h"

namespace loopd {

// The steps from an open video node to a stream that can be started, each with its own errors.

/// An open node and what its errors are told with.
struct V4l2Context {
  const V4l2Node& node;
  const V4l2Paths& paths;
  const std::string& path;  ///< "/dev/video0"
};

/// What a capture node says of itself.
struct V4l2Capability {
  std::string driver;
  std::string card;
  std::string bus_info;
  std::uint32_t type = 0;  ///< of its capture queue, single- or multi-planar
};

/// Finds out whether the node is one that frames can be streamed from. Errors: it is none (the
/// metadata node of a USB camera, an output); the message names the right one if there is one.
std::optional<CameraError> check_capture_node(const V4l2Context& context,
                                              V4l2Capability& capability);

/// Adopts the timings of a digital video input (HDMI, SDI); without effect on all other inputs.
/// Errors: nothing is connected to it, or nothing it can lock on (kNoSignal).
std::optional<CameraError> lock_on_signal(const V4l2Context& context);

/// Why the current input gives no picture ("no signal"); none if it does not complain.
std::optional<std::string> input_trouble(const V4l2Node& node);

/// What a node will stream.
struct V4l2Stream {
  PixelFormat format = PixelFormat::kGrey;
  int width_px = 0;
  int height_px = 0;
  int stride_bytes = 0;
  double fps = 0;  ///< 0: not known
  std::vector<std::string> warnings;
};

/// Sets the best format, size and rate for the wish. Errors: nothing of what the camera offers can
/// be read or is of the wished format; it is busy.
std::optional<CameraError> negotiate(const V4l2Context& context, std::uint32_t type, V4l2Wish wish,
                                     V4l2Stream& stream);

}  // namespace loopd
