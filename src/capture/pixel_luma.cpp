#include "capture/pixel_luma.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cerrno>

#include "capture/decode.h"
#include "capture/luma_rows.h"

namespace loopd {
namespace {

using Problem = LumaConverter::Problem;

constexpr int kMaxSide_px = 65535;

struct RowForm {
  std::size_t bytes_per_pixel = 1;
  void (*to_luma)(const std::uint8_t*, std::size_t, std::uint8_t*) = nullptr;
};

void copy_row(const std::uint8_t* pixels, std::size_t width, std::uint8_t* luma) {
  std::copy_n(pixels, width, luma);
}

RowForm row_form(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGrey:
    case PixelFormat::kNv12:
    case PixelFormat::kYu12:
      return {1, copy_row};
    case PixelFormat::kYuyv:
      return {2, luma_row_even_bytes};
    case PixelFormat::kUyvy:
    case PixelFormat::kY16:
      return {2, luma_row_odd_bytes};
    case PixelFormat::kY10:
      return {2, luma_row_y10};
    case PixelFormat::kRgb24:
      return {3, luma_row_rgb<0>};
    case PixelFormat::kBgr24:
      return {3, luma_row_rgb<2>};
    case PixelFormat::kMjpeg:
      break;
  }
  return {};
}

std::string size_text(int width_px, int height_px) {
  return std::to_string(width_px) + "x" + std::to_string(height_px);
}

Problem corrupt(std::string message) { return {CameraFault::kCorruptFrame, std::move(message)}; }

// Whether the rows that width, height and stride promise lie within the bytes.
std::optional<Problem> check_rows(const RawFrame& frame, std::size_t row_bytes) {
  if (frame.stride_bytes < 1 || static_cast<std::size_t>(frame.stride_bytes) < row_bytes)
    return corrupt("its rows of " + std::to_string(frame.width_px) + " pixels take " +
                   std::to_string(row_bytes) + " bytes, but the driver gives a stride of " +
                   std::to_string(frame.stride_bytes));
  const std::size_t needed =
      static_cast<std::size_t>(frame.stride_bytes) * static_cast<std::size_t>(frame.height_px - 1) +
      row_bytes;
  if (frame.bytes.size() < needed)
    return corrupt("it holds " + std::to_string(frame.bytes.size()) + " of " +
                   std::to_string(needed) + " bytes");
  return std::nullopt;
}

std::optional<Problem> convert_rows(const RawFrame& frame, std::uint8_t* luma) {
  const RowForm form = row_form(frame.format);
  if (form.to_luma == nullptr) return corrupt("its pixel format is not known here");
  const auto width = static_cast<std::size_t>(frame.width_px);
  const std::size_t row_bytes = width * form.bytes_per_pixel;
  if (auto problem = check_rows(frame, row_bytes)) return problem;
  const auto stride = static_cast<std::size_t>(frame.stride_bytes);
  const auto height = static_cast<std::size_t>(frame.height_px);
  if (stride == row_bytes) {
    form.to_luma(frame.bytes.data(), width * height, luma);
    return std::nullopt;
  }
  for (std::size_t y = 0; y < height; ++y)
    form.to_luma(frame.bytes.data() + y * stride, width, luma + y * width);
  return std::nullopt;
}

}  // namespace

struct LumaConverter::Jpeg {
  explicit Jpeg(std::size_t max_pixels) : decoder(max_pixels) {}

  std::optional<Problem> convert(const RawFrame& frame, std::span<std::uint8_t> luma) {
    if (image_format(frame.bytes) != ImageFormat::kJpeg) return corrupt("its data is no JPEG");
    const Result<ImageSize> size = decoder.size(frame.bytes);
    if (!size.ok()) return problem_of(size.error());
    // Written whole into a buffer for the promised size, so nothing else will do.
    if (size.value().width_px != frame.width_px || size.value().height_px != frame.height_px)
      return corrupt("its JPEG is " + size_text(size.value().width_px, size.value().height_px) +
                     ", not the " + size_text(frame.width_px, frame.height_px) +
                     " that the driver promised");
    const Result<ImageSize> decoded = decoder.decode(frame.bytes, luma);
    if (!decoded.ok()) return problem_of(decoded.error());
    return std::nullopt;
  }

  // What the driver promised has been found small enough: a larger JPEG is a damaged one.
  static Problem problem_of(const Error& error) {
    return {CameraFault::kCorruptFrame, error.message};
  }

  ImageDecoder decoder;
};

LumaConverter::LumaConverter(std::size_t max_pixels)
    : max_pixels_(max_pixels), jpeg_(std::make_unique<Jpeg>(max_pixels)) {
  assert(max_pixels >= 1);
}

LumaConverter::~LumaConverter() = default;

std::optional<Problem> LumaConverter::convert(const RawFrame& frame, std::span<std::uint8_t> luma) {
  if (frame.width_px < 1 || frame.height_px < 1 || frame.width_px > kMaxSide_px ||
      frame.height_px > kMaxSide_px)
    return corrupt("the driver gives its size as " + size_text(frame.width_px, frame.height_px));
  const std::size_t pixels =
      static_cast<std::size_t>(frame.width_px) * static_cast<std::size_t>(frame.height_px);
  if (pixels > max_pixels_)
    return Problem{CameraFault::kTooLarge, "it is " + size_text(frame.width_px, frame.height_px) +
                                               ", more than the " + std::to_string(max_pixels_) +
                                               " pixels of camera.max_pixels; raise it or choose "
                                               "a smaller size"};
  assert(luma.size() >= pixels);
  if (frame.format == PixelFormat::kMjpeg) return jpeg_->convert(frame, luma);
  return convert_rows(frame, luma.data());
}

}  // namespace loopd
