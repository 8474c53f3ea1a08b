#include "features/image_pyramid.h"

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstring>
#include <span>

namespace loopd {
namespace {

using ColumnBlock = ImagePyramid::ColumnBlock;
using Bytes8 = std::uint8_t __attribute__((vector_size(8)));

constexpr std::size_t kBlock = 8;
constexpr std::size_t kSlack = 32;  // bytes behind a row that wide reads and writes may touch

int level_size(int side_px, double factor) {
  return std::max(1, static_cast<int>(static_cast<double>(side_px) / factor + 0.5));
}

std::size_t padded(int width_px) { return (static_cast<std::size_t>(width_px) + 31) / 32 * 32; }

// (a (256 - w) + b w) / 256, rounded.
LOOPD_INLINE void mix_rows_in(const std::uint8_t* a, const std::uint8_t* b, unsigned weight,
                              std::size_t count, std::uint8_t* __restrict out) {
  const auto wa = static_cast<std::uint16_t>(256 - weight), wb = static_cast<std::uint16_t>(weight);
  for (std::size_t x = 0; x < count; ++x)
    out[x] =
        static_cast<std::uint8_t>(static_cast<std::uint16_t>(a[x] * wa + b[x] * wb + 128) >> 8);
}

void mix_rows_baseline(const std::uint8_t* a, const std::uint8_t* b, unsigned weight,
                       std::size_t count, std::uint8_t* out) {
  mix_rows_in(a, b, weight, count, out);
}

void pick_columns(const std::uint8_t* row, const std::int32_t* first, const std::uint16_t* weight,
                  std::size_t count, std::uint8_t* out) {
  for (std::size_t x = 0; x < count; ++x) {
    const std::uint8_t* at = row + first[x];
    out[x] = static_cast<std::uint8_t>((at[0] * (256 - weight[x]) + at[1] * weight[x] + 128) >> 8);
  }
}

#if defined(__x86_64__)

LOOPD_AVX2 void mix_rows_avx2(const std::uint8_t* a, const std::uint8_t* b, unsigned weight,
                              std::size_t count, std::uint8_t* out) {
  mix_rows_in(a, b, weight, count, out);
}

// pick_columns() a block of 8 at a time: its bytes by one shuffle of the 16 they come from.
LOOPD_AVX2 void pick_blocks(const std::uint8_t* row, std::span<const ColumnBlock> blocks,
                            std::uint8_t* out) {
  using Halves = std::uint16_t __attribute__((vector_size(16)));
  for (const ColumnBlock& block : blocks) {
    const simd::Bytes16 picked = __builtin_shuffle(simd::load<simd::Bytes16>(row + block.base),
                                                   simd::load<simd::Bytes16>(block.byte.data()));
    Halves pairs, weight;
    std::memcpy(&pairs, &picked, sizeof(pairs));
    std::memcpy(&weight, block.weight.data(), sizeof(weight));
    // The first pixel is a pair's low byte.
    const Halves mixed = ((pairs & 0xff) * (256 - weight) + (pairs >> 8) * weight + 128) >> 8;
    const auto bytes = __builtin_convertvector(mixed, Bytes8);
    std::memcpy(out, &bytes, sizeof(bytes));
    out += kBlock;
  }
}

#endif

}  // namespace

// Pixel x of `to` has its centre at (x + 1/2) from/to - 1/2.
void ImagePyramid::place(int from_px, int to_px, Axis& axis) {
  axis.first.resize(static_cast<std::size_t>(to_px));
  axis.weight.resize(static_cast<std::size_t>(to_px));
  const std::int64_t last = static_cast<std::int64_t>(from_px - 1) * 256;
  for (int x = 0; x < to_px; ++x) {
    const std::int64_t centre =
        (2 * static_cast<std::int64_t>(x) + 1) * from_px * 128 / to_px - 128;
    const std::int64_t position = std::clamp<std::int64_t>(centre, 0, last);
    axis.first[static_cast<std::size_t>(x)] = static_cast<std::int32_t>(position >> 8);
    axis.weight[static_cast<std::size_t>(x)] = static_cast<std::uint16_t>(position & 255);
  }
}

void ImagePyramid::gather_blocks(Level& level) {
  const Axis& columns = level.columns;
  level.blocks.assign(padded(level.width_px) / kBlock, ColumnBlock{});
  for (std::size_t x = 0; x < columns.first.size(); ++x) {
    ColumnBlock& block = level.blocks[x / kBlock];
    const std::size_t i = x % kBlock;
    if (i == 0) block.base = columns.first[x];
    const std::int32_t byte = columns.first[x] - block.base;
    if (byte > 14) {
      level.blocks.clear();
      return;
    }
    block.byte[2 * i] = static_cast<std::uint8_t>(byte);
    block.byte[2 * i + 1] = static_cast<std::uint8_t>(byte + 1);
    block.weight[i] = columns.weight[x];
  }
}

void ImagePyramid::plan(int width_px, int height_px, double scale, int levels) {
  scale_ = scale;
  levels_ = levels;
  level_.resize(static_cast<std::size_t>(levels));
  level_[0].width_px = width_px;
  level_[0].height_px = height_px;
  double factor = 1;
  for (std::size_t i = 1; i < level_.size(); ++i) {
    factor *= scale;
    Level& level = level_[i];
    level.width_px = level_size(width_px, factor);
    level.height_px = level_size(height_px, factor);
    level.stride_bytes = static_cast<int>(padded(level.width_px));
    place(level_[i - 1].width_px, level.width_px, level.columns);
    place(level_[i - 1].height_px, level.height_px, level.rows);
    gather_blocks(level);
    level.pixels.resize(static_cast<std::size_t>(level.stride_bytes) *
                            static_cast<std::size_t>(level.height_px) +
                        kSlack);
  }
  row_.assign(padded(width_px) + kSlack, 0);
}

void ImagePyramid::start(const LumaView& image, double scale, int levels) {
  assert(image.width_px >= 1 && image.height_px >= 1 && levels >= 1 && scale > 1 && scale <= 4);
  const bool planned = levels == levels_ && scale == scale_ && image.width_px == image_.width_px &&
                       image.height_px == image_.height_px;
  if (!planned) plan(image.width_px, image.height_px, scale, levels);
  image_ = image;
  built_ = 1;
}

void ImagePyramid::build_next() {
  assert(built_ >= 1 && built_ < levels_);
  const LumaView from = level(built_ - 1);
  Level& to = level_[static_cast<std::size_t>(built_)];
  auto mix_rows = mix_rows_baseline;
#if defined(__x86_64__)
  if (form_ == SimdForm::kAvx2) mix_rows = mix_rows_avx2;
#endif
  const auto width = static_cast<std::size_t>(from.width_px);
  for (int y = 0; y < to.height_px; ++y) {
    const std::int32_t row = to.rows.first[static_cast<std::size_t>(y)];
    const std::uint8_t* above = from.data + static_cast<std::ptrdiff_t>(row) * from.stride_bytes;
    const std::uint8_t* below = row + 1 < from.height_px ? above + from.stride_bytes : above;
    mix_rows(above, below, to.rows.weight[static_cast<std::size_t>(y)], width, row_.data());
    std::uint8_t* out = to.pixels.data() + static_cast<std::ptrdiff_t>(y) * to.stride_bytes;
#if defined(__x86_64__)
    if (form_ == SimdForm::kAvx2 && !to.blocks.empty()) {
      pick_blocks(row_.data(), to.blocks, out);
      continue;
    }
#endif
    pick_columns(row_.data(), to.columns.first.data(), to.columns.weight.data(),
                 static_cast<std::size_t>(to.width_px), out);
  }
  ++built_;
}

void ImagePyramid::build(const LumaView& image, double scale, int levels) {
  start(image, scale, levels);
  while (built_ < levels_) build_next();
}

LumaView ImagePyramid::level(int index) const {
  assert(index >= 0 && index < built_);
  if (index == 0) return image_;
  const Level& level = level_[static_cast<std::size_t>(index)];
  return {level.pixels.data(), level.width_px, level.height_px, level.stride_bytes};
}

}  // namespace loopd
