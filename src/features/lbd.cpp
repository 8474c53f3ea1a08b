#include "features/lbd.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace loopd {
namespace {

constexpr int kBands = 9;
constexpr int kBandRows = 7;
constexpr int kRows = kBands * kBandRows;
constexpr float kRowStepPx = 1.0F;
constexpr int kAtOnce = 4;             // samples
constexpr float kSampleStepPx = 1.5F;  // at most, along a line
constexpr int kMaxSamples = 48;        // along a line; longer lines are sampled more sparsely

using Gradient = GradientImage::Gradient;

// The gradient's half-sums of one row: towards and against the line's direction and its normal.
using RowSums = float __attribute__((vector_size(16)));
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

// Fixed point of a direction's components; a gradient turned into the line's frame then loses
// kDropBits, so that the sum of all samples fits 32 bits.
constexpr int kDirectionBits = 14;
constexpr int kDropBits = 8;
static_assert((std::int64_t{GradientImage::kLargest} * 3 << (kDirectionBits - kDropBits - 1)) *
                  kMaxSamples <
              INT32_MAX);

// The frame of one line: where to sample and which way it points.
struct LineFrame {
  float x = 0;
  float y = 0;
  float dx = 0;  // unit vector along the line; its normal (to the right on the screen) is -dy, dx
  float dy = 0;
  float step = 0;
  int samples = 0;  // a multiple of kAtOnce
};

// The fixed point ends at 2^15, and samples lie up to half the descriptor's height beside the line.
constexpr float kFarthestPx = 16'384;

LineFrame frame_of(const Line& any) {
  const auto near = [](float v) { return std::clamp(v, -kFarthestPx, kFarthestPx); };
  const Line line{near(any.start_x_px), near(any.start_y_px), near(any.end_x_px),
                  near(any.end_y_px)};
  const float vx = line.end_x_px - line.start_x_px;
  const float vy = line.end_y_px - line.start_y_px;
  const float length = std::sqrt(vx * vx + vy * vy);
  if (!(length >= 1)) return {line.start_x_px, line.start_y_px, 1, 0, 0, kAtOnce};
  const int fours = static_cast<int>(length / (kSampleStepPx * kAtOnce)) + 1;
  const int samples = std::min(kAtOnce * fours, kMaxSamples);
  return {line.start_x_px,
          line.start_y_px,
          vx / length,
          vy / length,
          length / static_cast<float>(samples),
          samples};
}

// A row of samples in fixed point.
struct Row {
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t step_x = 0;
  std::int32_t step_y = 0;
  int samples = 0;
};

Row row_of(const LineFrame& frame, float offset) {
  return {fixed(frame.x - frame.dy * offset + 0.5F * frame.step * frame.dx + 0.5F),
          fixed(frame.y + frame.dx * offset + 0.5F * frame.step * frame.dy + 0.5F),
          fixed(frame.step * frame.dx), fixed(frame.step * frame.dy), frame.samples};
}

// Sums over a row of the gradient along and across the line, and of their magnitudes.
struct Sums {
  std::int32_t along = 0;
  std::int32_t across = 0;
  std::int32_t along_abs = 0;
  std::int32_t across_abs = 0;
};

// The line's direction in fixed point, as one gradient pixel is laid out.
struct Direction {
  std::int16_t x = 0;
  std::int16_t y = 0;
};

Direction direction_of(const LineFrame& frame) {
  constexpr float kOne = 1 << kDirectionBits;
  return {static_cast<std::int16_t>(frame.dx * kOne), static_cast<std::int16_t>(frame.dy * kOne)};
}

// Four samples at a time, one by one.
class PlainAccumulator {
 public:
  explicit PlainAccumulator(Direction d) : d_(d) {}

  void add(const Gradient& a, const Gradient& b, const Gradient& c, const Gradient& d) {
    for (const Gradient* g : {&a, &b, &c, &d}) {
      const std::int32_t along = (g->x * d_.x + g->y * d_.y) >> kDropBits;
      const std::int32_t across = (g->y * d_.x - g->x * d_.y) >> kDropBits;
      sums_.along += along;
      sums_.across += across;
      sums_.along_abs += std::abs(along);
      sums_.across_abs += std::abs(across);
    }
  }
  Sums sums() const { return sums_; }

 private:
  Direction d_;
  Sums sums_;
};

#if defined(__SSE2__)

// Four samples at a time: a multiply-add of 16-bit pairs turns a gradient.
class Accumulator {
 public:
  explicit Accumulator(Direction d)
      : along_(_mm_set_epi16(d.y, d.x, d.y, d.x, d.y, d.x, d.y, d.x)),
        across_(_mm_set_epi16(d.x, minus(d.y), d.x, minus(d.y), d.x, minus(d.y), d.x, minus(d.y))) {
  }

  void add(const Gradient& a, const Gradient& b, const Gradient& c, const Gradient& d) {
    const __m128i four = _mm_unpacklo_epi64(_mm_unpacklo_epi32(load(a), load(b)),
                                            _mm_unpacklo_epi32(load(c), load(d)));
    add(_mm_srai_epi32(_mm_madd_epi16(four, along_), kDropBits), along_sum_, along_abs_);
    add(_mm_srai_epi32(_mm_madd_epi16(four, across_), kDropBits), across_sum_, across_abs_);
  }
  Sums sums() const {
    return {total(along_sum_), total(across_sum_), total(along_abs_), total(across_abs_)};
  }

 private:
  static std::int16_t minus(std::int16_t v) { return static_cast<std::int16_t>(-v); }
  static __m128i load(const Gradient& g) {
    std::int32_t both = 0;
    std::memcpy(&both, &g, sizeof both);
    return _mm_cvtsi32_si128(both);
  }
  static void add(__m128i values, __m128i& sum, __m128i& abs) {
    const __m128i sign = _mm_srai_epi32(values, 31);
    sum = _mm_add_epi32(sum, values);
    abs = _mm_add_epi32(abs, _mm_sub_epi32(_mm_xor_si128(values, sign), sign));
  }
  static std::int32_t total(__m128i v) {
    const __m128i half = _mm_add_epi32(v, _mm_shuffle_epi32(v, _MM_SHUFFLE(1, 0, 3, 2)));
    return _mm_cvtsi128_si32(_mm_add_epi32(half, _mm_shuffle_epi32(half, 1)));
  }

  __m128i along_;
  __m128i across_;
  __m128i along_sum_ = _mm_setzero_si128();
  __m128i across_sum_ = _mm_setzero_si128();
  __m128i along_abs_ = _mm_setzero_si128();
  __m128i across_abs_ = _mm_setzero_si128();
};

#else
using Accumulator = PlainAccumulator;
#endif

template <class Adder, class Read>
Sums sum_row(const Read& read, Row row, Direction direction) {
  Adder accumulator(direction);
  const auto next = [&]() -> const Gradient& {
    const Gradient& g = read(row.x >> kFraction, row.y >> kFraction);
    row.x += row.step_x;
    row.y += row.step_y;
    return g;
  };
  for (int i = 0; i < row.samples; i += kAtOnce) {
    const Gradient& a = next();
    const Gradient& b = next();
    const Gradient& c = next();
    const Gradient& d = next();
    accumulator.add(a, b, c, d);
  }
  return accumulator.sums();
}

RowSums half_sums(const Sums& sums, float weight) {
  const float half = 0.5F * weight;
  const auto along = static_cast<float>(sums.along);
  const auto across = static_cast<float>(sums.across);
  const auto along_abs = static_cast<float>(sums.along_abs);
  const auto across_abs = static_cast<float>(sums.across_abs);
  return RowSums{across_abs + across, across_abs - across, along_abs + along, along_abs - along} *
         half;
}

float offset_of(int row) { return static_cast<float>(row - kRows / 2) * kRowStepPx; }

// Every sample of the line's rows lies in the image, with a pixel to spare for rounding.
bool is_inside(const GradientImage& gradient, const LineFrame& frame) {
  const float length = frame.step * static_cast<float>(frame.samples);
  const auto max_x = static_cast<float>(gradient.width_px - 2);
  const auto max_y = static_cast<float>(gradient.height_px - 2);
  for (const float along : {0.0F, length})
    for (const float offset : {offset_of(0), offset_of(kRows - 1)}) {
      const float x = frame.x + along * frame.dx - offset * frame.dy;
      const float y = frame.y + along * frame.dy + offset * frame.dx;
      if (!(x >= 1 && x <= max_x && y >= 1 && y <= max_y)) return false;
    }
  return true;
}

template <class Adder>
std::array<RowSums, kRows> sum_rows(const GradientImage& gradient, const Line& line) {
  const LineFrame frame = frame_of(line);
  const Direction direction = direction_of(frame);
  const int width = gradient.width_px;
  const int max_x = width - 1;
  const int max_y = gradient.height_px - 1;
  const Gradient* pixels = gradient.pixels.data();
  const auto read = [&](int x, int y) -> const Gradient& { return pixels[y * width + x]; };
  const auto read_clamped = [&](int x, int y) -> const Gradient& {
    return pixels[std::clamp(y, 0, max_y) * width + std::clamp(x, 0, max_x)];
  };
  const bool inside = is_inside(gradient, frame);
  std::array<RowSums, kRows> rows;
  for (int row = 0; row < kRows; ++row) {
    const Row samples = row_of(frame, offset_of(row));
    const Sums sums = inside ? sum_row<Adder>(read, samples, direction)
                             : sum_row<Adder>(read_clamped, samples, direction);
    const auto r = static_cast<std::size_t>(row);
    rows[r] = half_sums(sums, kGlobalWeights[r]);
  }
  return rows;
}

// Rows of a band and of its neighbours, as far as there are any.
BandValues describe_band(const std::array<RowSums, kRows>& rows, int band) {
  const int first = std::max(0, (band - 1) * kBandRows);
  const int last = std::min(kRows, (band + 2) * kBandRows);
  const auto count = static_cast<float>(last - first);
  RowSums sum{};
  RowSums squares{};
  for (int row = first; row < last; ++row) {
    const RowSums value = rows[static_cast<std::size_t>(row)] *
                          kLocalWeights[static_cast<std::size_t>(row - (band - 1) * kBandRows)];
    sum += value;
    squares += value * value;
  }
  const RowSums mean = sum / count;
  const RowSums variance = squares / count - mean * mean;
  BandValues values{};
  for (int k = 0; k < 4; ++k) {
    values[static_cast<std::size_t>(2 * k)] = mean[k];
    values[static_cast<std::size_t>(2 * k + 1)] = std::sqrt(std::max(0.0F, variance[k]));
  }
  return values;
}

template <class Adder>
Descriptor describe_line(const GradientImage& gradient, const Line& line) {
  const auto rows = sum_rows<Adder>(gradient, line);
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

void describe_lines(const GradientImage& gradient, std::span<const Line> lines,
                    std::span<Descriptor> descriptors) {
  assert(lines.size() == descriptors.size());
  for (std::size_t i = 0; i < lines.size(); ++i)
    descriptors[i] = describe_line<Accumulator>(gradient, lines[i]);
}

void describe_lines_plainly(const GradientImage& gradient, std::span<const Line> lines,
                            std::span<Descriptor> descriptors) {
  assert(lines.size() == descriptors.size());
  for (std::size_t i = 0; i < lines.size(); ++i)
    descriptors[i] = describe_line<PlainAccumulator>(gradient, lines[i]);
}

}  // namespace loopd
