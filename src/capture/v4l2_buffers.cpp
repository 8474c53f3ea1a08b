#include "capture/v4l2_buffers.h"

#include <fcntl.h>
#include <linux/dma-buf.h>

#include <algorithm>
#include <cassert>
#include <cerrno>

namespace loopd {
namespace {

constexpr std::uint32_t kMaxBuffers = 32;

}  // namespace

V4l2Buffers::~V4l2Buffers() {
  for (Buffer& buffer : buffers_)
    if (buffer.memory != nullptr) node_.io().unmap(buffer.memory, buffer.length);
  if (buffers_.empty()) return;
  buffers_.clear();  // closes what is exported: it would keep the memory
  v4l2_requestbuffers none{};
  none.type = type_;
  none.memory = V4L2_MEMORY_MMAP;
  node_.call(VIDIOC_REQBUFS, none);  // fails if the device has gone, and then close() does it
}

int V4l2Buffers::allocate(int count) {
  assert(buffers_.empty());
  v4l2_requestbuffers wish{};
  wish.count = static_cast<std::uint32_t>(count);
  wish.type = type_;
  wish.memory = V4L2_MEMORY_MMAP;
  if (const int result = node_.call(VIDIOC_REQBUFS, wish); result < 0) return result;
  if (wish.count < 1) return -ENOMEM;
  buffers_.resize(std::min(wish.count, kMaxBuffers));
  for (std::size_t i = 0; i < buffers_.size(); ++i) {
    if (const int result = map(i); result < 0) return result;
    export_buffer(i);
    if (const int result = queue(i); result < 0) return result;
  }
  return 0;
}

void V4l2Buffers::prepare(Request& request, std::size_t index) const {
  request.buffer.index = static_cast<std::uint32_t>(index);
  request.buffer.type = type_;
  request.buffer.memory = V4L2_MEMORY_MMAP;
  if (!multiplanar()) return;
  request.buffer.m.planes = request.planes.data();
  request.buffer.length = VIDEO_MAX_PLANES;
}

int V4l2Buffers::map(std::size_t index) {
  Request request;
  prepare(request, index);
  if (const int result = node_.call(VIDIOC_QUERYBUF, request.buffer); result < 0) return result;
  const std::size_t length = multiplanar() ? request.planes[0].length : request.buffer.length;
  const std::int64_t offset =
      multiplanar() ? request.planes[0].m.mem_offset : request.buffer.m.offset;
  if (length < 1) return -EPROTO;
  int error = 0;
  void* memory = node_.io().map(node_.fd(), length, offset, error);
  if (memory == nullptr) return error;
  buffers_[index].memory = memory;
  buffers_[index].length = length;
  if (index == 0) flags_ = request.buffer.flags;
  return 0;
}

void V4l2Buffers::export_buffer(std::size_t index) {
  v4l2_exportbuffer request{};
  request.type = type_;
  request.index = static_cast<std::uint32_t>(index);
  request.flags = O_CLOEXEC | O_RDONLY;
  if (node_.call(VIDIOC_EXPBUF, request) == 0)
    buffers_[index].exported = V4l2Node(node_.io(), request.fd);
}

int V4l2Buffers::queue(std::size_t index) {
  Request request;
  prepare(request, index);
  const int result = node_.call(VIDIOC_QBUF, request.buffer);
  buffers_[index].queued = result >= 0;
  return result;
}

int V4l2Buffers::take(Filled& filled) {
  Request request;
  prepare(request, 0);
  if (const int result = node_.call(VIDIOC_DQBUF, request.buffer); result < 0) return result;
  const std::size_t index = request.buffer.index;
  if (index >= buffers_.size() || !buffers_[index].queued) return -EPROTO;
  buffers_[index].queued = false;
  buffers_[index].taken = true;
  filled = {index, request.buffer.flags, request.buffer.sequence, request.buffer.timestamp,
            filled_bytes(request, buffers_[index])};
  return 0;
}

std::span<const std::uint8_t> V4l2Buffers::filled_bytes(const Request& request,
                                                        const Buffer& buffer) const {
  const auto* memory = static_cast<const std::uint8_t*>(buffer.memory);
  const v4l2_plane& plane = request.planes[0];
  const std::size_t used = multiplanar() ? plane.bytesused : request.buffer.bytesused;
  const std::size_t end = std::min(used, buffer.length);
  // In the planes, bytesused counts from the start of the memory, data_offset included.
  const std::size_t begin = multiplanar() ? std::min<std::size_t>(plane.data_offset, end) : 0;
  return {memory + begin, end - begin};
}

int V4l2Buffers::give_back(std::size_t index) {
  buffers_[index].taken = false;
  return queue(index);
}

int V4l2Buffers::requeue() {
  int failure = -EPROTO;
  bool any = false;
  for (std::size_t i = 0; i < buffers_.size(); ++i) {
    if (buffers_[i].taken) continue;
    const int result = buffers_[i].queued ? 0 : queue(i);
    any |= result >= 0;
    if (result < 0) failure = result;
  }
  return any ? 0 : failure;
}

void V4l2Buffers::sync(std::size_t index, bool begin) {
  Buffer& buffer = buffers_[index];
  if (!buffer.exported.valid()) return;
  dma_buf_sync request{};
  request.flags = DMA_BUF_SYNC_READ | (begin ? DMA_BUF_SYNC_START : DMA_BUF_SYNC_END);
  // Where it cannot be had, DQBUF has made the memory readable, as for every mapped buffer.
  if (buffer.exported.call(DMA_BUF_IOCTL_SYNC, request) < 0) buffer.exported.reset();
}

}  // namespace loopd
