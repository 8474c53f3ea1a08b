#include "features/lbd.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdlib>
#include <opencv2/imgproc.hpp>

namespace loopd {
namespace {

constexpr int kBands = 9;
constexpr int kBandRows = 7;
constexpr int kRows = kBands * kBandRows;
constexpr int kMaxSamples = 96;  // along a line; longer lines are sampled more sparsely

// The gradient's half-sums of one row: towards and against the line's direction and its normal.
using RowSums = std::array<float, 4>;
// Mean and deviation of the four half-sums of one band.
using BandValues = std::array<float, 8>;

struct BandPair {
  int a = 0;
  int b = 0;
};

// 32 of the 36 pairs of bands: all but the four farthest apart, whose order the weights decide.
constexpr std::array<BandPair, 32> band_pairs() {
  std::array<BandPair, 32> pairs{};
  std::size_t n = 0;
  for (int distance = 1; distance < kBands; ++distance)
    for (int a = 0; a + distance < kBands && n < pairs.size(); ++a) pairs[n++] = {a, a + distance};
  return pairs;
}

// exp(-x) for x in [0, 3] without libm, so that CPUs agree: (1 - x/256)^256.
constexpr float gaussian(float distance, float sigma) {
  const float x = distance * distance / (2 * sigma * sigma);
  float value = 1 - x / 256;
  for (int i = 0; i < 8; ++i) value *= value;
  return value;
}

// Rows far from the line weigh less (global weight of the descriptor's paper, sigma = half its
// height).
constexpr std::array<float, kRows> global_weights() {
  std::array<float, kRows> weights{};
  for (int row = 0; row < kRows; ++row)
    weights[static_cast<std::size_t>(row)] =
        gaussian(static_cast<float>(row - kRows / 2), 0.5F * (kRows - 1));
  return weights;
}

// Rows of the neighbouring bands weigh less within a band (local weight, sigma = band height).
constexpr std::array<float, 3 * kBandRows> local_weights() {
  std::array<float, 3 * kBandRows> weights{};
  for (int row = 0; row < 3 * kBandRows; ++row)
    weights[static_cast<std::size_t>(row)] =
        gaussian(static_cast<float>(row - 3 * kBandRows / 2), kBandRows);
  return weights;
}

constexpr auto kPairs = band_pairs();
constexpr auto kGlobalWeights = global_weights();
constexpr auto kLocalWeights = local_weights();

constexpr int kFraction = 16;  // fixed point of the sampling positions
std::int32_t fixed(float value) {
  return static_cast<std::int32_t>(value * static_cast<float>(1 << kFraction));
}

// The frame of one line: where to sample and which way it points.
struct LineFrame {
  float x = 0;
  float y = 0;
  float dx = 0;  // unit vector along the line; its normal (to the right on the screen) is -dy, dx
  float dy = 0;
  float step = 0;
  int samples = 0;
};

LineFrame frame_of(const Line& line) {
  const float vx = line.end_x_px - line.start_x_px;
  const float vy = line.end_y_px - line.start_y_px;
  const float length = std::sqrt(vx * vx + vy * vy);
  if (!(length >= 1)) return {line.start_x_px, line.start_y_px, 1, 0, 0, 1};
  const int samples = std::clamp(static_cast<int>(length), 1, kMaxSamples);
  return {line.start_x_px,
          line.start_y_px,
          vx / length,
          vy / length,
          length / static_cast<float>(samples),
          samples};
}

RowSums sum_row(const GradientImage& gradient, const LineFrame& frame, float offset) {
  std::int32_t x = fixed(frame.x - frame.dy * offset + 0.5F * frame.step * frame.dx + 0.5F);
  std::int32_t y = fixed(frame.y + frame.dx * offset + 0.5F * frame.step * frame.dy + 0.5F);
  const std::int32_t step_x = fixed(frame.step * frame.dx);
  const std::int32_t step_y = fixed(frame.step * frame.dy);
  const int max_x = gradient.width_px - 1;
  const int max_y = gradient.height_px - 1;
  float along_pos = 0;
  float along_abs = 0;
  float across_pos = 0;
  float across_abs = 0;
  for (int i = 0; i < frame.samples; ++i, x += step_x, y += step_y) {
    const auto& g =
        gradient.at(std::clamp(x >> kFraction, 0, max_x), std::clamp(y >> kFraction, 0, max_y));
    const auto gx = static_cast<float>(g.x);
    const auto gy = static_cast<float>(g.y);
    const float along = gx * frame.dx + gy * frame.dy;
    const float across = gy * frame.dx - gx * frame.dy;
    along_pos += std::max(along, 0.0F);
    along_abs += std::abs(along);
    across_pos += std::max(across, 0.0F);
    across_abs += std::abs(across);
  }
  return {across_pos, across_abs - across_pos, along_pos, along_abs - along_pos};
}

std::array<RowSums, kRows> sum_rows(const GradientImage& gradient, const Line& line) {
  const LineFrame frame = frame_of(line);
  std::array<RowSums, kRows> rows{};
  for (int row = 0; row < kRows; ++row) {
    const auto r = static_cast<std::size_t>(row);
    rows[r] = sum_row(gradient, frame, static_cast<float>(row - kRows / 2));
    for (float& value : rows[r]) value *= kGlobalWeights[r];
  }
  return rows;
}

// Rows of a band and of its neighbours, as far as there are any.
BandValues describe_band(const std::array<RowSums, kRows>& rows, int band) {
  const int first = std::max(0, (band - 1) * kBandRows);
  const int last = std::min(kRows, (band + 2) * kBandRows);
  const auto count = static_cast<float>(last - first);
  BandValues values{};
  for (std::size_t k = 0; k < 4; ++k) {
    float sum = 0;
    float squares = 0;
    for (int row = first; row < last; ++row) {
      const float value = rows[static_cast<std::size_t>(row)][k] *
                          kLocalWeights[static_cast<std::size_t>(row - (band - 1) * kBandRows)];
      sum += value;
      squares += value * value;
    }
    const float mean = sum / count;
    values[2 * k] = mean;
    values[2 * k + 1] = std::sqrt(std::max(0.0F, squares / count - mean * mean));
  }
  return values;
}

Descriptor describe_line(const GradientImage& gradient, const Line& line) {
  const auto rows = sum_rows(gradient, line);
  std::array<BandValues, kBands> bands;
  for (int band = 0; band < kBands; ++band)
    bands[static_cast<std::size_t>(band)] = describe_band(rows, band);

  Descriptor descriptor;
  std::size_t bit = 0;
  for (const BandPair& pair : kPairs) {
    const BandValues& a = bands[static_cast<std::size_t>(pair.a)];
    const BandValues& b = bands[static_cast<std::size_t>(pair.b)];
    for (std::size_t k = 0; k < a.size(); ++k, ++bit)
      if (a[k] > b[k]) descriptor.words[bit / 64] |= std::uint64_t{1} << (bit % 64);
  }
  return descriptor;
}

}  // namespace

void GradientImage::compute(const LumaView& image) {
  width_px = image.width_px;
  height_px = image.height_px;
  const auto width = static_cast<std::size_t>(width_px);
  const auto height = static_cast<std::size_t>(height_px);
  pixels.assign(width * height, {});
  smooth_.resize(width * height);
  const cv::Mat in(height_px, width_px, CV_8UC1, const_cast<std::uint8_t*>(image.data),
                   static_cast<std::size_t>(image.stride_bytes));
  cv::Mat out(height_px, width_px, CV_8UC1, smooth_.data(), width);
  cv::GaussianBlur(in, out, cv::Size(5, 5), 1.0);

  for (std::size_t y = 1; y + 1 < height; ++y) {
    const std::uint8_t* above = smooth_.data() + (y - 1) * width;
    const std::uint8_t* here = above + width;
    const std::uint8_t* below = here + width;
    Gradient* row = pixels.data() + y * width;
    for (std::size_t x = 1; x + 1 < width; ++x) {
      const int right = above[x + 1] + 2 * here[x + 1] + below[x + 1];
      const int left = above[x - 1] + 2 * here[x - 1] + below[x - 1];
      const int down = below[x - 1] + 2 * below[x] + below[x + 1];
      const int up = above[x - 1] + 2 * above[x] + above[x + 1];
      row[x] = {static_cast<std::int16_t>(right - left), static_cast<std::int16_t>(down - up)};
    }
  }
}

void direct_by_contrast(const GradientImage& gradient, std::span<Line> lines) {
  for (Line& line : lines) {
    const LineFrame frame = frame_of(line);
    float towards_right = 0;  // brightness growing to the right of the line
    for (const float offset : {-1.0F, 0.0F, 1.0F}) {
      const RowSums sums = sum_row(gradient, frame, offset);
      towards_right += sums[0] - sums[1];
    }
    if (towards_right > 0) {
      std::swap(line.start_x_px, line.end_x_px);
      std::swap(line.start_y_px, line.end_y_px);
    }
  }
}

void describe_lines(const GradientImage& gradient, std::span<const Line> lines,
                    std::span<Descriptor> descriptors) {
  assert(lines.size() == descriptors.size());
  for (std::size_t i = 0; i < lines.size(); ++i) descriptors[i] = describe_line(gradient, lines[i]);
}

}  // namespace loopd
