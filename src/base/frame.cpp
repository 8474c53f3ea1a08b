#include <cassert>
#include <cstring>

#include "loopd/frame.h"

namespace loopd {

Frame copy_to_frame(const LumaView& image, std::uint64_t sequence,
                    std::optional<std::int64_t> time_ns) {
  assert(image.data != nullptr && image.width_px >= 1 && image.height_px >= 1);
  assert(image.stride_bytes >= image.width_px);
  const auto width = static_cast<std::size_t>(image.width_px);
  const auto height = static_cast<std::size_t>(image.height_px);
  const auto stride = static_cast<std::size_t>(image.stride_bytes);
  Frame frame;
  frame.buffer = FrameBuffer(
      new std::uint8_t[width * height],
      FrameBufferRelease([](void*, std::uint8_t* data) noexcept { delete[] data; }, nullptr));
  for (std::size_t y = 0; y < height; ++y)
    std::memcpy(frame.buffer.get() + y * width, image.data + y * stride, width);
  frame.width_px = image.width_px;
  frame.height_px = image.height_px;
  frame.stride_bytes = image.width_px;
  frame.sequence = sequence;
  frame.time_ns = time_ns;
  return frame;
}

}  // namespace loopd
