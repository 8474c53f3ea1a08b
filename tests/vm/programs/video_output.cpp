#include "video_output.h"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

#include <cerrno>
#include <ctime>

#include "base/clock.h"

namespace loopd::vm {
namespace {

constexpr unsigned kBuffers = 4;

v4l2_buffer output_buffer() {
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  buffer.memory = V4L2_MEMORY_MMAP;
  return buffer;
}

Status set_format(int fd, const std::string& fourcc, int width_px, int height_px) {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  format.fmt.pix.width = static_cast<unsigned>(width_px);
  format.fmt.pix.height = static_cast<unsigned>(height_px);
  format.fmt.pix.pixelformat = v4l2_fourcc(fourcc[0], fourcc[1], fourcc[2], fourcc[3]);
  format.fmt.pix.field = V4L2_FIELD_NONE;
  const v4l2_pix_format wanted = format.fmt.pix;
  if (ioctl(fd, VIDIOC_S_FMT, &format) != 0) return errno_error("cannot set the format", errno);
  const v4l2_pix_format& got = format.fmt.pix;
  if (got.width != wanted.width || got.height != wanted.height ||
      got.pixelformat != wanted.pixelformat) {
    return Error{"the driver would not do " + fourcc + " " + std::to_string(width_px) + "x" +
                 std::to_string(height_px)};
  }
  return Nothing{};
}

}  // namespace

Result<VideoOutput> VideoOutput::open(const std::string& device, const std::string& fourcc,
                                      int width_px, int height_px) {
  UniqueFd fd(::open(device.c_str(), O_RDWR | O_CLOEXEC));
  if (!fd.valid()) return errno_error("cannot open " + device, errno);
  if (fourcc.size() != 4) return Error{"a format has four letters, not \"" + fourcc + "\""};
  const Status set = set_format(fd.get(), fourcc, width_px, height_px);
  if (!set) return Error{device + ": " + set.error().message, set.error().code};
  VideoOutput output(std::move(fd));
  const Status mapped = output.map_buffers();
  if (!mapped) return Error{device + ": " + mapped.error().message, mapped.error().code};
  int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  if (ioctl(output.fd_.get(), VIDIOC_STREAMON, &type) != 0) {
    return errno_error("cannot start the stream of " + device, errno);
  }
  return output;
}

VideoOutput::~VideoOutput() {
  for (const auto& buffer : buffers_) munmap(buffer.data(), buffer.size());
}

Status VideoOutput::map_buffers() {
  v4l2_requestbuffers request{};
  request.count = kBuffers;
  request.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
  request.memory = V4L2_MEMORY_MMAP;
  if (ioctl(fd_.get(), VIDIOC_REQBUFS, &request) != 0) {
    return errno_error("cannot get buffers", errno);
  }
  for (unsigned i = 0; i < request.count; ++i) {
    v4l2_buffer buffer = output_buffer();
    buffer.index = i;
    if (ioctl(fd_.get(), VIDIOC_QUERYBUF, &buffer) != 0) {
      return errno_error("cannot ask for a buffer", errno);
    }
    void* memory = mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, fd_.get(),
                        static_cast<off_t>(buffer.m.offset));
    if (memory == MAP_FAILED) return errno_error("cannot map a buffer", errno);
    buffers_.emplace_back(static_cast<std::uint8_t*>(memory), buffer.length);
  }
  return Nothing{};
}

Result<std::span<std::uint8_t>> VideoOutput::next_image() {
  if (unused_ < buffers_.size()) {
    current_ = unused_++;
  } else {
    v4l2_buffer buffer = output_buffer();
    if (ioctl(fd_.get(), VIDIOC_DQBUF, &buffer) != 0) {
      return errno_error("the driver gives no buffer back", errno);
    }
    current_ = buffer.index;
  }
  return buffers_[current_];
}

Status VideoOutput::show(std::size_t bytes) {
  v4l2_buffer buffer = output_buffer();
  buffer.index = static_cast<unsigned>(current_);
  buffer.bytesused = static_cast<unsigned>(bytes);
  buffer.field = V4L2_FIELD_NONE;
  const std::int64_t now_ns = monotonic_now_ns();
  buffer.timestamp.tv_sec = now_ns / 1'000'000'000;
  buffer.timestamp.tv_usec = now_ns % 1'000'000'000 / 1000;
  if (ioctl(fd_.get(), VIDIOC_QBUF, &buffer) != 0) {
    return errno_error("the driver does not take an image", errno);
  }
  return Nothing{};
}

}  // namespace loopd::vm
