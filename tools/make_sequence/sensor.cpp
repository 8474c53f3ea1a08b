#include "make_sequence/sensor.h"

#include <algorithm>
#include <cmath>

#include "make_sequence/random.h"

namespace loopd::sequence {
namespace {

/// Weights of a Gaussian, from the centre outwards, summing to 1 over both sides.
std::vector<float> gaussian(double sigma) {
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  std::vector<float> weights(static_cast<std::size_t>(radius) + 1);
  double sum = 0;
  for (int i = 0; i <= radius; ++i) {
    const double w = std::exp(-0.5 * i * i / (sigma * sigma));
    weights[static_cast<std::size_t>(i)] = static_cast<float>(w);
    sum += i == 0 ? w : 2 * w;
  }
  for (float& w : weights) w = static_cast<float>(w / sum);
  return weights;
}

void blur_rows(Radiance& image, int width, int height, const std::vector<float>& weights) {
  const int radius = static_cast<int>(weights.size()) - 1;
  std::vector<float> padded(static_cast<std::size_t>(width + 2 * radius));
  for (int y = 0; y < height; ++y) {
    float* row = &image[static_cast<std::size_t>(y) * static_cast<std::size_t>(width)];
    std::copy(row, row + width, padded.begin() + radius);
    std::fill(padded.begin(), padded.begin() + radius, row[0]);
    std::fill(padded.end() - radius, padded.end(), row[width - 1]);
    for (int x = 0; x < width; ++x) {
      const float* centre = &padded[static_cast<std::size_t>(x + radius)];
      float sum = weights[0] * centre[0];
      for (int i = 1; i <= radius; ++i) {
        sum += weights[static_cast<std::size_t>(i)] * (centre[-i] + centre[i]);
      }
      row[x] = sum;
    }
  }
}

void blur_columns(Radiance& image, int width, int height, const std::vector<float>& weights) {
  const int radius = static_cast<int>(weights.size()) - 1;
  const Radiance in = image;
  const auto row = [&](int y) {
    return &in[static_cast<std::size_t>(std::clamp(y, 0, height - 1)) *
               static_cast<std::size_t>(width)];
  };
  for (int y = 0; y < height; ++y) {
    float* out = &image[static_cast<std::size_t>(y) * static_cast<std::size_t>(width)];
    const float* centre = row(y);
    for (int x = 0; x < width; ++x) out[x] = weights[0] * centre[x];
    for (int i = 1; i <= radius; ++i) {
      const float* above = row(y - i);
      const float* below = row(y + i);
      const float w = weights[static_cast<std::size_t>(i)];
      for (int x = 0; x < width; ++x) out[x] += w * (above[x] + below[x]);
    }
  }
}

/// Close to a normal deviate: the sum of four uniforms (Irwin-Hall), mean 0, variance 1.
float deviate(std::uint64_t hash) {
  const auto sum = static_cast<std::int64_t>((hash & 0xffff) + ((hash >> 16) & 0xffff) +
                                             ((hash >> 32) & 0xffff) + (hash >> 48));
  constexpr float kScale = 1.7320508F / 65536;  // four uniforms have variance 1/3
  return static_cast<float>(sum - 2 * 65535) * kScale;
}

}  // namespace

void expose(Radiance& radiance, int width, int height, double gain, const SensorOptions& options,
            std::uint64_t noise_seed, std::vector<std::uint8_t>& out) {
  if (options.blur > 0) {
    const std::vector<float> weights = gaussian(options.blur);
    blur_rows(radiance, width, height, weights);
    blur_columns(radiance, width, height, weights);
  }
  out.resize(radiance.size());
  const auto scale = static_cast<float>(gain);
  const auto sigma = static_cast<float>(options.noise);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const float noise = sigma > 0 ? sigma * deviate(mix64(noise_seed + i)) : 0.0F;
    const float value = radiance[i] * scale + noise + 0.5F;
    out[i] = static_cast<std::uint8_t>(std::clamp(value, 0.0F, 255.0F));
  }
}

}  // namespace loopd::sequence
