#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "capture/capture_device.h"
#include "capture/v4l2_io.h"

namespace loopd {

/// How a V4L2 format's luma is read here; none if it is not. Variants that differ in chroma only,
/// or in how the planes are divided, share a PixelFormat.
std::optional<PixelFormat> pixel_format_from_fourcc(std::uint32_t fourcc);

/// "YUYV", "Y16 -BE"; characters that cannot be printed as '.'.
std::string fourcc_text(std::uint32_t fourcc);

/// A size that a camera offers in some format.
struct V4l2Size {
  int width_px = 0;
  int height_px = 0;
  std::vector<double> fps;  ///< as listed, or slowest and fastest of a range; empty: not known

  double fastest() const;  ///< 0 if not known
};

/// Sizes in steps, as drivers with a scaler offer them.
struct V4l2SizeRange {
  int min_width_px = 0, max_width_px = 0, step_width_px = 1;
  int min_height_px = 0, max_height_px = 0, step_height_px = 1;
};

/// A pixel format that a camera offers.
struct V4l2Mode {
  std::uint32_t fourcc = 0;
  std::optional<PixelFormat> format;  ///< none: not read here
  std::vector<V4l2Size> sizes;        ///< listed ones; empty where there is a range, or no list
  std::optional<V4l2SizeRange> range;
};

/// All formats of a node, with sizes and rates: of all, or of those that are read here, which is
/// much less to ask of some drivers. `type` is the buffer type of the capture queue. What a driver
/// gives without end or sense is cut off.
enum class ListSizes : std::uint8_t { kOfAll, kOfReadable };
std::vector<V4l2Mode> list_modes(const V4l2Node& node, std::uint32_t type, ListSizes sizes);

/// The rates at one size; empty if the driver does not tell.
std::vector<double> list_rates(const V4l2Node& node, std::uint32_t fourcc, int width_px,
                               int height_px);

/// What is wished of a stream; 0 = no wish.
struct V4l2Wish {
  int width_px = 0;
  int height_px = 0;
  double fps = 0;
  std::optional<PixelFormat> format;
};

/// A format and size to ask a driver for.
struct V4l2Choice {
  std::uint32_t fourcc = 0;
  int width_px = 0;
  int height_px = 0;
};

/// The size of `mode` nearest to the wish (of equals, the first listed); the wish itself where the
/// mode names no sizes.
V4l2Size nearest_size(const V4l2Mode& mode, const V4l2Wish& wish);

/// One choice for each mode of a wished and readable format, best first: nearest size, then the
/// least missing of the wished rate, then the least work to make luma. Without a wished rate, a
/// mode that cannot even reach 15 fps counts as too slow: USB 2 cameras offer their large sizes
/// uncompressed at 5 fps. `node` is asked for the rates of a size that is not listed.
/// Precondition: the wish has a size.
std::vector<V4l2Choice> rank_modes(const std::vector<V4l2Mode>& modes, const V4l2Wish& wish,
                                   const V4l2Node& node);

}  // namespace loopd
