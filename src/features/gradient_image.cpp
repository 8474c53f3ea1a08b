#include "features/gradient_image.h"

#include <algorithm>

namespace loopd {
namespace {

constexpr int kBorder = GradientImage::kBorderPx;
constexpr int kTaps = 2 * kBorder + 1;

// Both filters down the columns of five rows; the sums stay below 2^12.
void filter_columns(const std::uint8_t* __restrict top, std::size_t stride, std::size_t width,
                    std::int16_t* __restrict smooth, std::int16_t* __restrict difference) {
  const std::uint8_t* __restrict a = top;
  const std::uint8_t* __restrict b = a + stride;
  const std::uint8_t* __restrict c = b + stride;
  const std::uint8_t* __restrict d = c + stride;
  const std::uint8_t* __restrict e = d + stride;
  for (std::size_t x = 0; x < width; ++x) {
    smooth[x] = static_cast<std::int16_t>((a[x] + e[x]) + 4 * (b[x] + d[x]) + 6 * c[x]);
    difference[x] = static_cast<std::int16_t>((e[x] - a[x]) + 2 * (d[x] - b[x]));
  }
}

// The other filter along the row; `out` starts at the third pixel. The sums stay below 2^14.
void filter_row(const std::int16_t* __restrict smooth, const std::int16_t* __restrict difference,
                std::size_t count, std::int16_t* __restrict out) {
  for (std::size_t i = 0; i < count; ++i) {
    const std::int16_t* s = smooth + i;
    const std::int16_t* d = difference + i;
    out[2 * i] = static_cast<std::int16_t>((s[4] - s[0]) + 2 * (s[3] - s[1]));
    out[2 * i + 1] = static_cast<std::int16_t>((d[0] + d[4]) + 4 * (d[1] + d[3]) + 6 * d[2]);
  }
}

}  // namespace

void GradientImage::compute(const LumaView& image) {
  width_px = image.width_px;
  height_px = image.height_px;
  const auto width = static_cast<std::size_t>(width_px);
  const auto height = static_cast<std::size_t>(height_px);
  pixels.resize(width * height);
  if (width < kTaps || height < kTaps) {
    std::fill(pixels.begin(), pixels.end(), Gradient{});
    return;
  }
  smooth_.resize(width);
  difference_.resize(width);
  std::fill_n(pixels.begin(), kBorder * width, Gradient{});
  std::fill_n(pixels.end() - static_cast<std::ptrdiff_t>(kBorder * width), kBorder * width,
              Gradient{});
  const auto stride = static_cast<std::size_t>(image.stride_bytes);
  for (std::size_t y = kBorder; y + kBorder < height; ++y) {
    filter_columns(image.data + (y - kBorder) * stride, stride, width, smooth_.data(),
                   difference_.data());
    Gradient* out = pixels.data() + y * width;
    filter_row(smooth_.data(), difference_.data(), width - kTaps + 1,
               reinterpret_cast<std::int16_t*>(out + kBorder));
    std::fill_n(out, kBorder, Gradient{});
    std::fill_n(out + width - kBorder, kBorder, Gradient{});
  }
}

}  // namespace loopd
