#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

namespace loopd {

/// Read-only view of an 8-bit luma image: row y starts at `data + y * stride_bytes`.
/// Pixel (0, 0) is the centre of the top-left pixel. Does not own its pixels.
struct LumaView {
  const std::uint8_t* data = nullptr;
  int width_px = 0;
  int height_px = 0;
  int stride_bytes = 0;
};

/// Gives a buffer back to whoever lent it (a pool, or the heap).
class FrameBufferRelease {
 public:
  using Function = void (*)(void* owner, std::uint8_t* data) noexcept;
  FrameBufferRelease() = default;
  FrameBufferRelease(Function function, void* owner) : function_(function), owner_(owner) {}
  void operator()(std::uint8_t* data) const noexcept {
    if (function_ != nullptr) function_(owner_, data);
  }

 private:
  Function function_ = nullptr;
  void* owner_ = nullptr;
};

/// Owning pointer to the pixels of one frame; its destruction returns them to their pool.
using FrameBuffer = std::unique_ptr<std::uint8_t[], FrameBufferRelease>;

/// One image from a camera: 8-bit luma with its time and the driver's sequence number.
/// Move-only; the buffer returns to its pool on destruction. Thread: one owner at a time.
struct Frame {
  FrameBuffer buffer;
  int width_px = 0;
  int height_px = 0;
  int stride_bytes = 0;
  /// Capture time, CLOCK_MONOTONIC nanoseconds; none where the source knows no time
  /// (a folder of images without `times.txt` and without a rate).
  std::optional<std::int64_t> time_ns;
  /// The driver's frame counter; for a folder of images, the 0-based index of the file.
  std::uint64_t sequence = 0;

  LumaView view() const { return {buffer.get(), width_px, height_px, stride_bytes}; }
};

/// A frame on the heap holding a copy of `image`, rows packed (stride = width).
/// Throws std::bad_alloc. Precondition: width and height >= 1.
Frame copy_to_frame(const LumaView& image, std::uint64_t sequence,
                    std::optional<std::int64_t> time_ns = std::nullopt);

}  // namespace loopd
