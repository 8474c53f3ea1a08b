#include "features/reduce.h"

#include <cstddef>

namespace loopd {

int reduction_factor(int width_px, int height_px, int max_pixels) {
  int factor = 1;
  const auto reduced = [&] {
    return static_cast<std::int64_t>(width_px / factor) * (height_px / factor);
  };
  while (reduced() > max_pixels) ++factor;
  return factor;
}

LumaView reduce_image(const LumaView& image, int factor, std::vector<std::uint8_t>& storage) {
  if (factor == 1) return image;
  const int width = image.width_px / factor;
  const int height = image.height_px / factor;
  const auto area = static_cast<unsigned>(factor) * static_cast<unsigned>(factor);
  storage.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  std::uint8_t* out = storage.data();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      unsigned sum = 0;
      for (int dy = 0; dy < factor; ++dy) {
        const std::uint8_t* row =
            image.data + static_cast<std::ptrdiff_t>(y * factor + dy) * image.stride_bytes +
            static_cast<std::ptrdiff_t>(x) * factor;
        for (int dx = 0; dx < factor; ++dx) sum += row[dx];
      }
      *out++ = static_cast<std::uint8_t>((sum + area / 2) / area);
    }
  }
  return {storage.data(), width, height, width};
}

}  // namespace loopd
