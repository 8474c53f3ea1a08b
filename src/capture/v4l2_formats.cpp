#include "capture/v4l2_formats.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <tuple>
#include <utility>

namespace loopd {
namespace {

// More than any camera has; a driver that goes on beyond is not listened to.
constexpr std::uint32_t kMaxFormats = 64;
constexpr std::uint32_t kMaxSizes = 128;
constexpr std::uint32_t kMaxRates = 64;
constexpr std::uint32_t kMaxSide_px = 65535;

constexpr double kSlow_fps = 15;
constexpr double kRateTolerance = 0.01;  // 29.97 is as good as 30

constexpr std::array<std::pair<std::uint32_t, PixelFormat>, 19> kReadable{{
    {V4L2_PIX_FMT_GREY, PixelFormat::kGrey},   {V4L2_PIX_FMT_NV12, PixelFormat::kNv12},
    {V4L2_PIX_FMT_NV12M, PixelFormat::kNv12},  {V4L2_PIX_FMT_NV21, PixelFormat::kNv12},
    {V4L2_PIX_FMT_NV21M, PixelFormat::kNv12},  {V4L2_PIX_FMT_NV16, PixelFormat::kNv12},
    {V4L2_PIX_FMT_YUV420, PixelFormat::kYu12}, {V4L2_PIX_FMT_YUV420M, PixelFormat::kYu12},
    {V4L2_PIX_FMT_YVU420, PixelFormat::kYu12}, {V4L2_PIX_FMT_YUV422P, PixelFormat::kYu12},
    {V4L2_PIX_FMT_YUYV, PixelFormat::kYuyv},   {V4L2_PIX_FMT_YVYU, PixelFormat::kYuyv},
    {V4L2_PIX_FMT_UYVY, PixelFormat::kUyvy},   {V4L2_PIX_FMT_Y10, PixelFormat::kY10},
    {V4L2_PIX_FMT_Y16, PixelFormat::kY16},     {V4L2_PIX_FMT_RGB24, PixelFormat::kRgb24},
    {V4L2_PIX_FMT_BGR24, PixelFormat::kBgr24}, {V4L2_PIX_FMT_MJPEG, PixelFormat::kMjpeg},
    {V4L2_PIX_FMT_JPEG, PixelFormat::kMjpeg},
}};

int side_px(std::uint32_t side) { return static_cast<int>(std::min(side, kMaxSide_px)); }

void add_rate(std::vector<double>& rates, const v4l2_fract& interval) {
  if (interval.numerator > 0 && interval.denominator > 0)
    rates.push_back(static_cast<double>(interval.denominator) / interval.numerator);
}

V4l2SizeRange range_of(const v4l2_frmsize_stepwise& steps) {
  V4l2SizeRange range;
  range.min_width_px = std::max(side_px(steps.min_width), 1);
  range.max_width_px = std::max(side_px(steps.max_width), range.min_width_px);
  range.step_width_px = std::max(side_px(steps.step_width), 1);
  range.min_height_px = std::max(side_px(steps.min_height), 1);
  range.max_height_px = std::max(side_px(steps.max_height), range.min_height_px);
  range.step_height_px = std::max(side_px(steps.step_height), 1);
  return range;
}

void list_sizes(const V4l2Node& node, V4l2Mode& mode) {
  for (std::uint32_t i = 0; i < kMaxSizes; ++i) {
    v4l2_frmsizeenum size{};
    size.index = i;
    size.pixel_format = mode.fourcc;
    if (node.call(VIDIOC_ENUM_FRAMESIZES, size) < 0) return;
    if (size.type != V4L2_FRMSIZE_TYPE_DISCRETE) {
      mode.range = range_of(size.stepwise);
      return;
    }
    const int width_px = side_px(size.discrete.width);
    const int height_px = side_px(size.discrete.height);
    if (width_px < 1 || height_px < 1) continue;
    mode.sizes.push_back({width_px, height_px, list_rates(node, mode.fourcc, width_px, height_px)});
  }
}

long distance(const V4l2Size& size, const V4l2Wish& wish) {
  return std::labs(size.width_px - wish.width_px) + std::labs(size.height_px - wish.height_px);
}

// How much of the wished rate is missing, frames/s.
double missing_fps(const V4l2Size& size, double wished_fps) {
  const double wish = wished_fps > 0 ? wished_fps : kSlow_fps;
  const double fastest = size.fastest();
  return fastest > 0 && fastest < wish * (1 - kRateTolerance) ? wish - fastest : 0;
}

}  // namespace

std::optional<PixelFormat> pixel_format_from_fourcc(std::uint32_t fourcc) {
  for (const auto& [code, format] : kReadable)
    if (code == fourcc) return format;
  return std::nullopt;
}

std::string fourcc_text(std::uint32_t fourcc) {
  std::string text;
  for (unsigned shift : {0u, 8u, 16u, 24u}) {
    const auto letter = static_cast<char>(fourcc >> shift & 0x7f);
    text += letter >= ' ' && letter <= '~' ? letter : '.';
  }
  constexpr std::uint32_t kBigEndian = 1u << 31;
  return (fourcc & kBigEndian) != 0 ? text + "-BE" : text;
}

double V4l2Size::fastest() const {
  return fps.empty() ? 0 : *std::max_element(fps.begin(), fps.end());
}

std::vector<V4l2Mode> list_modes(const V4l2Node& node, std::uint32_t type, ListSizes sizes) {
  std::vector<V4l2Mode> modes;
  for (std::uint32_t i = 0; i < kMaxFormats; ++i) {
    v4l2_fmtdesc description{};
    description.index = i;
    description.type = type;
    if (node.call(VIDIOC_ENUM_FMT, description) < 0) break;
    V4l2Mode mode;
    mode.fourcc = description.pixelformat;
    mode.format = pixel_format_from_fourcc(mode.fourcc);
    const bool known = std::any_of(modes.begin(), modes.end(), [&](const V4l2Mode& other) {
      return other.fourcc == mode.fourcc;
    });
    if (known) continue;
    if (mode.format || sizes == ListSizes::kOfAll) list_sizes(node, mode);
    modes.push_back(std::move(mode));
  }
  return modes;
}

std::vector<double> list_rates(const V4l2Node& node, std::uint32_t fourcc, int width_px,
                               int height_px) {
  std::vector<double> rates;
  for (std::uint32_t i = 0; i < kMaxRates; ++i) {
    v4l2_frmivalenum interval{};
    interval.index = i;
    interval.pixel_format = fourcc;
    interval.width = static_cast<std::uint32_t>(width_px);
    interval.height = static_cast<std::uint32_t>(height_px);
    if (node.call(VIDIOC_ENUM_FRAMEINTERVALS, interval) < 0) break;
    if (interval.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
      add_rate(rates, interval.discrete);
      continue;
    }
    add_rate(rates, interval.stepwise.max);  // the longest interval is the slowest rate
    add_rate(rates, interval.stepwise.min);
    break;
  }
  return rates;
}

V4l2Size nearest_size(const V4l2Mode& mode, const V4l2Wish& wish) {
  if (mode.range) {
    const V4l2SizeRange& range = *mode.range;
    return {nearest_in_steps(wish.width_px, range.min_width_px, range.max_width_px,
                             range.step_width_px),
            nearest_in_steps(wish.height_px, range.min_height_px, range.max_height_px,
                             range.step_height_px),
            {}};
  }
  if (mode.sizes.empty()) return {wish.width_px, wish.height_px, {}};
  return *std::min_element(
      mode.sizes.begin(), mode.sizes.end(),
      [&](const V4l2Size& a, const V4l2Size& b) { return distance(a, wish) < distance(b, wish); });
}

std::vector<V4l2Choice> rank_modes(const std::vector<V4l2Mode>& modes, const V4l2Wish& wish,
                                   const V4l2Node& node) {
  using Cost = std::tuple<long, double, int>;
  std::vector<std::pair<Cost, V4l2Choice>> ranked;
  for (const V4l2Mode& mode : modes) {
    if (!mode.format || (wish.format && mode.format != wish.format)) continue;
    V4l2Size size = nearest_size(mode, wish);
    if (size.fps.empty()) size.fps = list_rates(node, mode.fourcc, size.width_px, size.height_px);
    const Cost cost{distance(size, wish), missing_fps(size, wish.fps), luma_cost(*mode.format)};
    ranked.push_back({cost, {mode.fourcc, size.width_px, size.height_px}});
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<V4l2Choice> choices;
  for (const auto& [cost, choice] : ranked) choices.push_back(choice);
  return choices;
}

}  // namespace loopd
