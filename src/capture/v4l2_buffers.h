#pragma once

#include <linux/videodev2.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "capture/v4l2_io.h"

namespace loopd {

/// Memory-mapped buffers of a capture queue, and which of them are the driver's at the moment.
///
/// Where the driver offers it, each buffer is also exported as a DMABUF, and reading is bracketed
/// by DMA_BUF_IOCTL_SYNC: so the kernel wants it for memory that a device and the CPU cache share.
/// All memory and descriptors go with the object, also when the device has gone away; the node must
/// outlive it. Move-only is not needed: made in place. Thread: one caller.
class V4l2Buffers {
 public:
  /// `type`: of the queue. The node must outlive this.
  V4l2Buffers(const V4l2Node& node, std::uint32_t type) : node_(node), type_(type) {}
  ~V4l2Buffers();
  V4l2Buffers(const V4l2Buffers&) = delete;
  V4l2Buffers& operator=(const V4l2Buffers&) = delete;

  /// Asks for `count` buffers, maps and queues what the driver gives. Returns 0 or -errno
  /// (-EPROTO: what the driver says makes no sense). `flags()` are known then.
  int allocate(int count);

  /// Flags of the first buffer: its time-stamp kind is that of the stream.
  std::uint32_t flags() const { return flags_; }

  /// A buffer that the driver has filled.
  struct Filled {
    std::size_t index = 0;
    std::uint32_t flags = 0;
    std::uint32_t sequence = 0;
    timeval timestamp{};
    std::span<const std::uint8_t> bytes;  ///< of the first plane; never beyond its memory
  };
  /// Takes the oldest filled buffer. Returns 0, -EAGAIN if there is none, or -errno.
  int take(Filled& filled);

  /// Gives a buffer back. On a failure it is tried again by requeue().
  int give_back(std::size_t index);

  /// Gives back all that a failure left here. Returns 0 if the driver has at least one buffer.
  int requeue();

  /// Makes what the device wrote visible to reads, until end_read().
  void begin_read(std::size_t index) { sync(index, true); }
  void end_read(std::size_t index) { sync(index, false); }

 private:
  struct Buffer {
    void* memory = nullptr;
    std::size_t length = 0;
    V4l2Node exported;  ///< DMABUF; invalid if the driver does not offer it
    bool queued = false;
    bool taken = false;
  };
  /// A v4l2_buffer with the room for planes that it may point to.
  struct Request {
    v4l2_buffer buffer{};
    std::array<v4l2_plane, VIDEO_MAX_PLANES> planes{};
  };

  bool multiplanar() const { return type_ == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE; }
  void prepare(Request& request, std::size_t index) const;
  int map(std::size_t index);
  void export_buffer(std::size_t index);
  int queue(std::size_t index);
  std::span<const std::uint8_t> filled_bytes(const Request& request, const Buffer& buffer) const;
  void sync(std::size_t index, bool begin);

  const V4l2Node& node_;
  const std::uint32_t type_;
  std::vector<Buffer> buffers_;
  std::uint32_t flags_ = 0;
};

}  // namespace loopd
