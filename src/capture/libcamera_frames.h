#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/result.h"
#include "capture/capture_device.h"

namespace loopd {

/// The luma plane (or the only plane) of one frame buffer, mapped for reading. It lies in a dmabuf,
/// or in any other file that can be mapped. Move-only; unmapped by destruction.
/// Thread: one owner at a time.
class MappedPlane {
 public:
  /// Maps `length` bytes from `offset` of `fd`, which stays the caller's and must stay open.
  /// Errors: the plane is empty, does not lie in the file, or cannot be mapped.
  static Result<MappedPlane> map(int fd, std::size_t offset, std::size_t length);

  ~MappedPlane();
  MappedPlane(MappedPlane&& other) noexcept;
  MappedPlane& operator=(MappedPlane&& other) noexcept;

  std::span<const std::uint8_t> bytes() const { return {mapping_ + offset_, length_}; }

  /// Around every reading: makes what the device wrote visible to the CPU, and gives the buffer
  /// back to the device. No-ops on what is no dmabuf.
  void begin_read() const { sync(true); }
  void end_read() const { sync(false); }

 private:
  MappedPlane(int fd, const std::uint8_t* mapping, std::size_t offset, std::size_t length)
      : fd_(fd), mapping_(mapping), offset_(offset), length_(length) {}
  void sync(bool start) const;

  int fd_ = -1;
  const std::uint8_t* mapping_ = nullptr;  ///< of the file from its start
  std::size_t offset_ = 0;
  std::size_t length_ = 0;
};

/// What a pipeline negotiated for every frame.
struct FrameLayout {
  PixelFormat format = PixelFormat::kGrey;
  int width_px = 0;
  int height_px = 0;
  int stride_bytes = 0;
};

/// The layout of what libcamera configured: stride 0 for MJPG, the packed row where the pipeline
/// gives none. None if a number is no size of an image, or a row does not fit into its stride.
std::optional<FrameLayout> checked_layout(PixelFormat format, unsigned width, unsigned height,
                                          unsigned stride);

/// A RawFrame of `layout` over the first `bytes_used` bytes of `plane`, bounded by the plane:
/// nothing that the pipeline says makes it reach beyond. Time, sequence and damage are the
/// caller's.
RawFrame raw_frame(const FrameLayout& layout, std::span<const std::uint8_t> plane,
                   std::size_t bytes_used);

/// How far a frame's sequence number lies after another's; those of the kernel have 32 bits and
/// wrap.
std::int32_t sequence_ahead(std::uint32_t later, std::uint32_t earlier);

/// Whether a frame is older than `last`, which was given out already, so that it comes too late. A
/// sequence that goes back by more than `buffers`, which is more than can be under way, has begun
/// anew instead; one that stands still is not late.
bool comes_late(std::uint32_t sequence, std::optional<std::uint32_t> last, std::size_t buffers);

}  // namespace loopd
