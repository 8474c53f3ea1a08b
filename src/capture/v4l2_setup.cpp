#include "capture/v4l2_setup.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "capture/v4l2_error.h"
#include "capture/v4l2_sysfs.h"

namespace loopd {
namespace {

constexpr std::uint32_t kMaxSide_px = 65535;

template <std::size_t kSize>
std::string text_of(const __u8 (&field)[kSize]) {
  const auto* text = reinterpret_cast<const char*>(field);
  return std::string(text, ::strnlen(text, kSize));
}

CameraError error(const V4l2Context& context, const std::string& tried, int result) {
  return v4l2_error(context.paths, context.path, tried, result);
}

std::uint32_t node_capabilities(const v4l2_capability& answer) {
  return (answer.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? answer.device_caps
                                                           : answer.capabilities;
}

// The type of the capture queue; 0 if there is none.
std::uint32_t capture_type(std::uint32_t capabilities) {
  if ((capabilities & V4L2_CAP_STREAMING) == 0) return 0;
  if ((capabilities & V4L2_CAP_VIDEO_CAPTURE) != 0) return V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if ((capabilities & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0)
    return V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
  return 0;
}

std::string kind_of_node(std::uint32_t capabilities) {
  constexpr std::uint32_t kCapture = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE;
  constexpr std::uint32_t kOutput = V4L2_CAP_VIDEO_OUTPUT | V4L2_CAP_VIDEO_OUTPUT_MPLANE;
  if ((capabilities & kCapture) != 0) return "cannot stream, only be read from";
  if ((capabilities & V4L2_CAP_META_CAPTURE) != 0) return "gives metadata, not pictures";
  if ((capabilities & kOutput) != 0)
    return "is an output, or a loopback device that nothing feeds yet";
  return "is no capture node";
}

// The node of the same device that frames can be had from; empty if none is found.
std::string capture_sibling(const V4l2Context& context) {
  for (const std::string& path : sibling_nodes(context.paths, context.path)) {
    int failure = 0;
    const V4l2Node node = V4l2Node::open(context.node.io(), path, failure);
    v4l2_capability answer{};
    if (node.valid() && node.call(VIDIOC_QUERYCAP, answer) >= 0 &&
        capture_type(node_capabilities(answer)) != 0)
      return path;
  }
  return {};
}

std::optional<v4l2_input> current_input(const V4l2Node& node) {
  int index = 0;
  if (node.call(VIDIOC_G_INPUT, index) < 0) return std::nullopt;
  v4l2_input input{};
  input.index = static_cast<std::uint32_t>(index);
  if (node.call(VIDIOC_ENUMINPUT, input) < 0) return std::nullopt;
  return input;
}

// ---- format

struct Format {
  std::uint32_t fourcc = 0;
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::uint32_t stride_bytes = 0;
  std::uint32_t field = 0;
};

bool multiplanar(const v4l2_format& format) {
  return format.type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
}

Format format_of(const v4l2_format& format) {
  if (multiplanar(format)) {
    const v4l2_pix_format_mplane& pix = format.fmt.pix_mp;
    return {pix.pixelformat, pix.width, pix.height, pix.plane_fmt[0].bytesperline, pix.field};
  }
  const v4l2_pix_format& pix = format.fmt.pix;
  return {pix.pixelformat, pix.width, pix.height, pix.bytesperline, pix.field};
}

// Everything that follows from size and format is left for the driver to say.
v4l2_format request_for(std::uint32_t type, const V4l2Choice& choice) {
  v4l2_format format{};
  format.type = type;
  const auto fill = [&](auto& pix) {
    pix.width = static_cast<std::uint32_t>(choice.width_px);
    pix.height = static_cast<std::uint32_t>(choice.height_px);
    pix.pixelformat = choice.fourcc;
    pix.field = V4L2_FIELD_NONE;
  };
  if (multiplanar(format))
    fill(format.fmt.pix_mp);
  else
    fill(format.fmt.pix);
  return format;
}

// For drivers that leave it open.
std::uint32_t usual_stride(PixelFormat format, std::uint32_t width_px) {
  switch (format) {
    case PixelFormat::kGrey:
    case PixelFormat::kNv12:
    case PixelFormat::kYu12:
      return width_px;
    case PixelFormat::kRgb24:
    case PixelFormat::kBgr24:
      return 3 * width_px;
    case PixelFormat::kMjpeg:
      return 0;
    default:
      return 2 * width_px;
  }
}

// False if what the driver made of the format is nothing to stream.
bool adopt(const Format& format, const V4l2Wish& wish, V4l2Stream& stream) {
  const std::optional<PixelFormat> readable = pixel_format_from_fourcc(format.fourcc);
  if (!readable || (wish.format && readable != wish.format)) return false;
  if (format.width_px < 1 || format.height_px < 1 || format.width_px > kMaxSide_px ||
      format.height_px > kMaxSide_px)
    return false;
  stream.format = *readable;
  stream.width_px = static_cast<int>(format.width_px);
  stream.height_px = static_cast<int>(format.height_px);
  const std::uint32_t stride =
      format.stride_bytes > 0 ? format.stride_bytes : usual_stride(*readable, format.width_px);
  constexpr std::uint32_t kLargestStride = 1u << 30;
  stream.stride_bytes =
      *readable == PixelFormat::kMjpeg ? 0 : static_cast<int>(std::min(stride, kLargestStride));
  return true;
}

void warn_about_fields(const Format& format, V4l2Stream& stream) {
  constexpr std::array<std::uint32_t, 3> kWhole{V4L2_FIELD_NONE, V4L2_FIELD_ANY, V4L2_FIELD_TOP};
  if (std::find(kWhole.begin(), kWhole.end(), format.field) == kWhole.end())
    stream.warnings.push_back(
        "the camera gives interlaced fields, which tear what moves; choose a progressive input");
}

std::string size_text(int width_px, int height_px) {
  return std::to_string(width_px) + "x" + std::to_string(height_px);
}

std::string offer_text(const std::vector<V4l2Mode>& modes) {
  std::string text;
  for (const V4l2Mode& mode : modes) text += (text.empty() ? "" : ", ") + fourcc_text(mode.fourcc);
  return text;
}

CameraError no_format(const V4l2Context& context, const std::vector<V4l2Mode>& modes,
                      const V4l2Wish& wish) {
  const std::string offers = "it offers " + offer_text(modes);
  if (wish.format)
    return v4l2_fault(CameraFault::kUnsupported, context.path,
                      "does not give the format " + std::string(pixel_format_name(*wish.format)) +
                          "; " + offers + "; set camera.format to \"auto\" or one of these");
  return v4l2_fault(CameraFault::kUnsupported, context.path,
                    "gives no pixel format that can be read here; " + offers +
                        "; if it is a raw sensor, use camera.source = \"libcamera\"");
}

std::optional<CameraError> set_format(const V4l2Context& context, std::uint32_t type,
                                      const std::vector<V4l2Mode>& modes, const V4l2Wish& wish,
                                      V4l2Stream& stream) {
  int refused = 0;
  for (const V4l2Choice& choice : rank_modes(modes, wish, context.node)) {
    v4l2_format format = request_for(type, choice);
    const int result = context.node.call(VIDIOC_S_FMT, format);
    if (result >= 0 && adopt(format_of(format), wish, stream)) {
      warn_about_fields(format_of(format), stream);
      return std::nullopt;
    }
    if (result < 0 && result != -EINVAL)
      return error(context, "set the format " + fourcc_text(choice.fourcc) + " of", result);
    refused = std::min(refused, result);
  }
  if (refused < 0) return error(context, "set a format of", refused);
  return no_format(context, modes, wish);
}

// ---- rate

std::string fps_text(double fps) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g fps", fps);
  return text.data();
}

double fps_of(const v4l2_streamparm& parameters) {
  const v4l2_fract& interval = parameters.parm.capture.timeperframe;
  if (interval.numerator == 0 || interval.denominator == 0) return 0;
  return static_cast<double>(interval.denominator) / interval.numerator;
}

// After the format: some drivers (vivid) forget the rate with each format set.
double set_rate(const V4l2Node& node, std::uint32_t type, double wish_fps) {
  v4l2_streamparm parameters{};
  parameters.type = type;
  if (node.call(VIDIOC_G_PARM, parameters) < 0) return 0;
  if (wish_fps <= 0 || (parameters.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) == 0)
    return fps_of(parameters);
  v4l2_streamparm wish{};
  wish.type = type;
  wish.parm.capture.timeperframe = {1000,
                                    static_cast<std::uint32_t>(std::llround(wish_fps * 1000))};
  return fps_of(node.call(VIDIOC_S_PARM, wish) < 0 ? parameters : wish);
}

void compare_with_wish(const V4l2Wish& wish, V4l2Stream& stream) {
  if (wish.width_px != stream.width_px || wish.height_px != stream.height_px)
    stream.warnings.push_back("the camera gives " + size_text(stream.width_px, stream.height_px) +
                              " instead of " + size_text(wish.width_px, wish.height_px));
  if (wish.fps > 0 && stream.fps > 0 && std::abs(stream.fps - wish.fps) > wish.fps / 50)
    stream.warnings.push_back("the camera gives " + fps_text(stream.fps) + " instead of " +
                              fps_text(wish.fps));
}

}  // namespace

std::optional<CameraError> check_capture_node(const V4l2Context& context,
                                              V4l2Capability& capability) {
  v4l2_capability answer{};
  if (const int result = context.node.call(VIDIOC_QUERYCAP, answer); result < 0)
    return error(context, "ask what kind of device is", result);
  const std::uint32_t capabilities = node_capabilities(answer);
  capability = {text_of(answer.driver), text_of(answer.card), text_of(answer.bus_info),
                capture_type(capabilities)};
  if (capability.type != 0) return std::nullopt;
  const std::string right_one = capture_sibling(context);
  return v4l2_fault(CameraFault::kUnsupported, context.path,
                    "(" + capability.card + ") " + kind_of_node(capabilities) +
                        (right_one.empty() ? "; choose another (loopctl cameras)"
                                           : "; the camera's pictures come from " + right_one));
}

std::optional<CameraError> lock_on_signal(const V4l2Context& context) {
  const std::optional<v4l2_input> input = current_input(context.node);
  if (!input || (input->capabilities & V4L2_IN_CAP_DV_TIMINGS) == 0) return std::nullopt;
  v4l2_dv_timings timings{};
  const int result = context.node.call(VIDIOC_QUERY_DV_TIMINGS, timings);
  const std::string name = "(input " + text_of(input->name) + ") ";
  if (result == -ENOLINK)
    return v4l2_fault(CameraFault::kNoSignal, context.path,
                      name + "has no signal; check the cable and the source's power");
  if (result == -ENOLCK || result == -ERANGE)
    return v4l2_fault(CameraFault::kNoSignal, context.path,
                      name +
                          "cannot lock on its signal; check the cable, or choose a resolution "
                          "the grabber knows");
  if (result < 0) return std::nullopt;  // no way to ask: what is set stays
  if (const int set = context.node.call(VIDIOC_S_DV_TIMINGS, timings); set < 0)
    return error(context, "adopt the video timings of", set);
  return std::nullopt;
}

std::optional<std::string> input_trouble(const V4l2Node& node) {
  const std::optional<v4l2_input> input = current_input(node);
  if (!input) return std::nullopt;
  if ((input->status & V4L2_IN_ST_NO_POWER) != 0) return "no power";
  if ((input->status & V4L2_IN_ST_NO_SIGNAL) != 0) return "no signal";
  constexpr std::uint32_t kNoLock =
      V4L2_IN_ST_NO_SYNC | V4L2_IN_ST_NO_H_LOCK | V4L2_IN_ST_NO_V_LOCK | V4L2_IN_ST_NO_CARRIER;
  if ((input->status & kNoLock) != 0) return "a signal it cannot lock on";
  return std::nullopt;
}

std::optional<CameraError> negotiate(const V4l2Context& context, std::uint32_t type, V4l2Wish wish,
                                     V4l2Stream& stream) {
  v4l2_format current{};
  current.type = type;
  const int result = context.node.call(VIDIOC_G_FMT, current);
  if (result == -EINVAL)  // v4l2loopback, until something feeds it
    return v4l2_fault(CameraFault::kNoSignal, context.path,
                      "has no picture format; if it is a loopback device, start what feeds it");
  if (result < 0) return error(context, "ask for the format of", result);
  const Format now = format_of(current);
  if (wish.width_px < 1)
    wish.width_px = static_cast<int>(std::clamp(now.width_px, 1u, kMaxSide_px));
  if (wish.height_px < 1)
    wish.height_px = static_cast<int>(std::clamp(now.height_px, 1u, kMaxSide_px));
  std::vector<V4l2Mode> modes = list_modes(context.node, type, ListSizes::kOfReadable);
  if (modes.empty()) modes.push_back({now.fourcc, pixel_format_from_fourcc(now.fourcc), {}, {}});
  if (auto failure = set_format(context, type, modes, wish, stream)) return failure;
  stream.fps = set_rate(context.node, type, wish.fps);
  compare_with_wish(wish, stream);
  return std::nullopt;
}

}  // namespace loopd
