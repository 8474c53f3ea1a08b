#include "capture/libcamera_frames.h"

#include <linux/dma-buf.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

namespace loopd {
namespace {

constexpr unsigned kMaxSide_px = 65535;

unsigned bytes_per_pixel(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGrey:
    case PixelFormat::kNv12:
    case PixelFormat::kYu12:
      return 1;
    case PixelFormat::kY10:
    case PixelFormat::kY16:
    case PixelFormat::kYuyv:
    case PixelFormat::kUyvy:
      return 2;
    case PixelFormat::kRgb24:
    case PixelFormat::kBgr24:
      return 3;
    case PixelFormat::kMjpeg:
      return 0;
  }
  return 0;
}

}  // namespace

Result<MappedPlane> MappedPlane::map(int fd, std::size_t offset, std::size_t length) {
  const off_t size = ::lseek(fd, 0, SEEK_END);
  if (size < 0) return errno_error("cannot find the size of a frame buffer", errno);
  const auto bytes = static_cast<std::size_t>(size);
  if (length == 0 || offset > bytes || length > bytes - offset)
    return Error{"a frame buffer of " + std::to_string(bytes) +
                     " bytes does not hold its plane of " + std::to_string(length) + " bytes at " +
                     std::to_string(offset),
                 EINVAL};
  // From the start of the file: the offset need not be a multiple of a page.
  void* mapping = ::mmap(nullptr, offset + length, PROT_READ, MAP_SHARED, fd, 0);
  if (mapping == MAP_FAILED) return errno_error("cannot map a frame buffer", errno);
  return MappedPlane(fd, static_cast<const std::uint8_t*>(mapping), offset, length);
}

MappedPlane::~MappedPlane() {
  if (mapping_ != nullptr) ::munmap(const_cast<std::uint8_t*>(mapping_), offset_ + length_);
}

MappedPlane::MappedPlane(MappedPlane&& other) noexcept
    : fd_(other.fd_),
      mapping_(std::exchange(other.mapping_, nullptr)),
      offset_(other.offset_),
      length_(other.length_) {}

MappedPlane& MappedPlane::operator=(MappedPlane&& other) noexcept {
  std::swap(fd_, other.fd_);
  std::swap(mapping_, other.mapping_);
  std::swap(offset_, other.offset_);
  std::swap(length_, other.length_);
  return *this;
}

void MappedPlane::sync(bool start) const {
  dma_buf_sync request{};
  request.flags = DMA_BUF_SYNC_READ | (start ? DMA_BUF_SYNC_START : DMA_BUF_SYNC_END);
  // An error can only mean that the file is no dmabuf, which needs none of this.
  while (::ioctl(fd_, DMA_BUF_IOCTL_SYNC, &request) != 0 && (errno == EINTR || errno == EAGAIN)) {
  }
}

std::optional<FrameLayout> checked_layout(PixelFormat format, unsigned width, unsigned height,
                                          unsigned stride) {
  if (width == 0 || height == 0 || width > kMaxSide_px || height > kMaxSide_px) return std::nullopt;
  const unsigned row = width * bytes_per_pixel(format);
  if (row == 0) stride = 0;  // MJPG has no rows
  if (row != 0 && stride == 0) stride = row;
  if (stride < row || stride > 16 * kMaxSide_px) return std::nullopt;
  return FrameLayout{format, static_cast<int>(width), static_cast<int>(height),
                     static_cast<int>(stride)};
}

RawFrame raw_frame(const FrameLayout& layout, std::span<const std::uint8_t> plane,
                   std::size_t bytes_used) {
  RawFrame frame;
  frame.format = layout.format;
  frame.width_px = layout.width_px;
  frame.height_px = layout.height_px;
  frame.stride_bytes = layout.stride_bytes;
  frame.bytes = plane.first(std::min(bytes_used, plane.size()));
  return frame;
}

std::int32_t sequence_ahead(std::uint32_t later, std::uint32_t earlier) {
  return static_cast<std::int32_t>(later - earlier);
}

bool comes_late(std::uint32_t sequence, std::optional<std::uint32_t> last, std::size_t buffers) {
  if (!last) return false;
  const std::uint32_t behind = *last - sequence;
  return behind != 0 && behind <= buffers;
}

}  // namespace loopd
