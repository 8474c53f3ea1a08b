#include "support/fake_v4l2.h"

#include <linux/dma-buf.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

namespace loopd::testing {
namespace {

constexpr std::uint32_t kBuffers = 4;

bool multiplanar(const FakeNode& node) {
  return (node.capabilities & V4L2_CAP_VIDEO_CAPTURE_MPLANE) != 0;
}

std::uint32_t frame_bytes(const v4l2_format& format) {
  return format.type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE
             ? format.fmt.pix_mp.plane_fmt[0].sizeimage
             : format.fmt.pix.sizeimage;
}

// Filled to its end without a zero, if the text is that long: the kernel promises no more.
template <std::size_t kSize>
void write_text(__u8 (&field)[kSize], const std::string& text) {
  std::memcpy(field, text.data(), std::min(text.size(), kSize));
}

}  // namespace

bool FakeV4l2::signal() { return interrupted && ++interruptions_ % 2 == 1; }

int FakeV4l2::open(const std::string& path) {
  if (signal()) return -EINTR;
  const std::string name = path.substr(path.rfind('/') + 1);
  if (const auto result = open_results.find(name); result != open_results.end())
    return result->second;
  const auto node = nodes_.find(name);
  if (node == nodes_.end() || node->second.gone) return -ENODEV;
  open_[next_fd_] = name;
  return next_fd_++;
}

void FakeV4l2::close(int fd) {
  if (exported_.erase(fd) > 0) return;
  const auto entry = open_.find(fd);
  if (entry == open_.end()) throw std::logic_error("closed a descriptor that is not open");
  FakeNode& node = nodes_[entry->second];
  node.streaming = false;
  node.queue.clear();
  open_.erase(entry);
}

int FakeV4l2::ioctl(int fd, unsigned long request, void* argument) {
  ++calls;
  requests.insert(request);
  if (signal()) return -EINTR;
  if (exported_.contains(fd)) return request == DMA_BUF_IOCTL_SYNC ? 0 : -ENOTTY;
  const auto entry = open_.find(fd);
  if (entry == open_.end()) return -EBADF;
  FakeNode& node = nodes_[entry->second];
  if (node.gone) return -ENODEV;
  if (const auto fault = node.faults.find(request); fault != node.faults.end()) {
    const int result = fault->second.result;
    if (fault->second.times > 0 && --fault->second.times == 0) node.faults.erase(fault);
    return result;
  }
  const int result = usual(node, request, argument);
  if (result >= 0 && node.lie) node.lie(request, argument);
  return result;
}

int FakeV4l2::usual(FakeNode& node, unsigned long request, void* argument) {
  switch (request) {
    case VIDIOC_QUERYCAP: {
      auto& answer = *static_cast<v4l2_capability*>(argument);
      write_text(answer.card, node.card);
      std::strcpy(reinterpret_cast<char*>(answer.bus_info), "platform:fake");
      answer.capabilities = V4L2_CAP_DEVICE_CAPS | 0x07ffffff;  // of the whole device: misleading
      answer.device_caps = node.capabilities;
      return 0;
    }
    case VIDIOC_G_INPUT:
      *static_cast<int*>(argument) = 0;
      return node.input_status || node.dv_timings ? 0 : -ENOTTY;
    case VIDIOC_ENUMINPUT: {
      auto& input = *static_cast<v4l2_input*>(argument);
      std::strcpy(reinterpret_cast<char*>(input.name), "HDMI");
      input.status = node.input_status.value_or(0);
      input.capabilities = node.dv_timings ? V4L2_IN_CAP_DV_TIMINGS : 0;
      return 0;
    }
    case VIDIOC_QUERY_DV_TIMINGS:
      return node.dv_timings.value_or(-ENOTTY);
    case VIDIOC_S_DV_TIMINGS:
    case VIDIOC_SUBSCRIBE_EVENT:
      return 0;
    case VIDIOC_DQEVENT: {
      if (node.events.empty()) return -ENOENT;
      auto& event = *static_cast<v4l2_event*>(argument);
      event.type = V4L2_EVENT_SOURCE_CHANGE;
      event.u.src_change.changes = node.events.front();
      node.events.pop_front();
      return 0;
    }
    case VIDIOC_G_FMT: {
      auto& format = *static_cast<v4l2_format*>(argument);
      v4l2_format current = node.format;
      current.type = format.type;
      set_format(node, current);
      format = current;
      return 0;
    }
    case VIDIOC_S_FMT:
      if (node.busy) return -EBUSY;
      return set_format(node, *static_cast<v4l2_format*>(argument));
    case VIDIOC_G_PARM:
    case VIDIOC_S_PARM: {
      auto& parameters = *static_cast<v4l2_streamparm*>(argument);
      auto& interval = parameters.parm.capture.timeperframe;
      if (request == VIDIOC_S_PARM && interval.numerator > 0)
        node.fps = interval.denominator / interval.numerator;
      parameters.parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
      interval = {1, node.fps};
      return 0;
    }
    case VIDIOC_STREAMON:
      node.streaming = true;
      return 0;
    case VIDIOC_STREAMOFF:
      node.streaming = false;
      return 0;
    case VIDIOC_QUERYCTRL:
    case VIDIOC_S_CTRL:
      return control(node, request, argument);
    case VIDIOC_ENUM_FMT:
    case VIDIOC_ENUM_FRAMESIZES:
    case VIDIOC_ENUM_FRAMEINTERVALS:
      return list(node, request, argument);
    default:
      return buffer(node, request, argument);
  }
}

int FakeV4l2::list(FakeNode& node, unsigned long request, void* argument) {
  const auto at = [&](const auto& items, std::uint32_t index) {
    return node.endless ? &items[index % items.size()]
                        : (index < items.size() ? &items[index] : nullptr);
  };
  const auto format_of = [&](std::uint32_t fourcc) {
    return std::find_if(node.formats.begin(), node.formats.end(),
                        [&](const auto& format) { return format.fourcc == fourcc; });
  };
  if (request == VIDIOC_ENUM_FMT) {
    auto& description = *static_cast<v4l2_fmtdesc*>(argument);
    const auto* format = at(node.formats, description.index);
    if (format == nullptr) return -EINVAL;
    description.pixelformat = format->fourcc + (node.endless ? description.index << 24 : 0);
    return 0;
  }
  if (request == VIDIOC_ENUM_FRAMESIZES) {
    auto& size = *static_cast<v4l2_frmsizeenum*>(argument);
    const auto format = node.endless ? node.formats.begin() : format_of(size.pixel_format);
    if (format == node.formats.end()) return -EINVAL;
    const auto* found = at(format->sizes, size.index);
    if (found == nullptr) return -EINVAL;
    size.type = V4L2_FRMSIZE_TYPE_DISCRETE;
    size.discrete = {found->width, found->height};
    return 0;
  }
  auto& interval = *static_cast<v4l2_frmivalenum*>(argument);
  const auto format = node.endless ? node.formats.begin() : format_of(interval.pixel_format);
  if (format == node.formats.end()) return -EINVAL;
  for (const FakeNode::Size& size : format->sizes) {
    if (size.width != interval.width || size.height != interval.height) continue;
    const std::uint32_t* fps = at(size.fps, interval.index);
    if (fps == nullptr) return -EINVAL;
    interval.type = V4L2_FRMIVAL_TYPE_DISCRETE;
    interval.discrete = {1, *fps};
    return 0;
  }
  return -EINVAL;
}

int FakeV4l2::control(FakeNode& node, unsigned long request, void* argument) {
  if (request == VIDIOC_QUERYCTRL) {
    auto& query = *static_cast<v4l2_queryctrl*>(argument);
    const std::uint32_t index = query.id & ~V4L2_CTRL_FLAG_NEXT_CTRL;  // ids are index + 1
    if (index >= node.controls.size()) return -EINVAL;
    const FakeNode::Control& control = node.controls[index];
    query = {};
    query.id = index + 1;
    write_text(query.name, control.name);
    query.minimum = control.least;
    query.maximum = control.most;
    query.flags = control.flags;
    return 0;
  }
  auto& setting = *static_cast<v4l2_control*>(argument);
  if (setting.id < 1 || setting.id > node.controls.size()) return -EINVAL;
  FakeNode::Control& control = node.controls[setting.id - 1];
  if (control.refusal != 0) return control.refusal;
  control.value = setting.value;
  return 0;
}

// The nearest of the sizes, 2 bytes a pixel.
int FakeV4l2::set_format(FakeNode& node, v4l2_format& format) {
  const bool planes = multiplanar(node);
  const std::uint32_t fourcc = planes ? format.fmt.pix_mp.pixelformat : format.fmt.pix.pixelformat;
  auto found = std::find_if(node.formats.begin(), node.formats.end(),
                            [&](const auto& entry) { return entry.fourcc == fourcc; });
  if (found == node.formats.end()) found = node.formats.begin();
  FakeNode::Size size{8, 4, {}};
  long best = 1L << 40;
  for (const FakeNode::Size& candidate : found->sizes) {
    const long distance =
        std::labs(static_cast<long>(candidate.width) -
                  static_cast<long>(planes ? format.fmt.pix_mp.width : format.fmt.pix.width));
    if (distance >= best) continue;
    best = distance;
    size = candidate;
  }
  if (planes) {
    format.fmt.pix_mp.pixelformat = found->fourcc;
    format.fmt.pix_mp.width = size.width;
    format.fmt.pix_mp.height = size.height;
    format.fmt.pix_mp.plane_fmt[0] = {size.width * size.height * 2, size.width * 2, {}};
    format.fmt.pix_mp.num_planes = 1;
  } else {
    format.fmt.pix.pixelformat = found->fourcc;
    format.fmt.pix.width = size.width;
    format.fmt.pix.height = size.height;
    format.fmt.pix.bytesperline = size.width * 2;
    format.fmt.pix.sizeimage = size.width * size.height * 2;
  }
  node.format = format;
  return 0;
}

int FakeV4l2::buffer(FakeNode& node, unsigned long request, void* argument) {
  if (request == VIDIOC_REQBUFS) {
    auto& wish = *static_cast<v4l2_requestbuffers*>(argument);
    if (node.busy) return -EBUSY;
    if (wish.count == 0 && !mapped_.empty()) return -EBUSY;
    wish.count = std::min(wish.count, kBuffers);
    if (wish.count == 0) return 0;  // the memory stays, for mappings that outlive their buffers
    node.memory.assign(wish.count, std::vector<std::uint8_t>(frame_bytes(node.format)));
    node.queued.assign(wish.count, false);
    node.queue.clear();
    return 0;
  }
  if (request == VIDIOC_EXPBUF) {
    if (!node.exports) return -ENOTTY;
    exported_.insert(next_fd_);
    static_cast<v4l2_exportbuffer*>(argument)->fd = next_fd_++;
    return 0;
  }
  auto& buffer = *static_cast<v4l2_buffer*>(argument);
  if (request == VIDIOC_DQBUF) return dequeue(node, buffer);
  if (buffer.index >= node.memory.size()) return -EINVAL;
  if (request == VIDIOC_QUERYBUF) {
    const auto length = static_cast<std::uint32_t>(node.memory[buffer.index].size());
    buffer.flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    if (multiplanar(node)) {
      buffer.m.planes[0].length = length;
      buffer.m.planes[0].m.mem_offset = buffer.index << 12;
    } else {
      buffer.length = length;
      buffer.m.offset = buffer.index << 12;
    }
    return 0;
  }
  if (request != VIDIOC_QBUF) return -ENOTTY;
  if (node.queued[buffer.index]) return -EINVAL;
  node.queued[buffer.index] = true;
  node.queue.push_back(buffer.index);
  ++node.requeued;
  return 0;
}

int FakeV4l2::dequeue(FakeNode& node, v4l2_buffer& buffer) {
  if (!node.streaming) return -EINVAL;
  if (node.frames.empty() || node.queue.empty()) return -EAGAIN;
  const FakeFrame frame = node.frames.front();
  node.frames.pop_front();
  const std::uint32_t index = node.queue.front();
  node.queue.pop_front();
  node.queued[index] = false;
  std::fill(node.memory[index].begin(), node.memory[index].end(), frame.value);
  buffer.index = index;
  buffer.flags = frame.flags;
  buffer.sequence = frame.sequence;
  buffer.timestamp = {frame.time_us / 1'000'000, frame.time_us % 1'000'000};
  const auto all = static_cast<std::uint32_t>(node.memory[index].size());
  if (multiplanar(node))
    buffer.m.planes[0].bytesused = frame.bytesused.value_or(all);
  else
    buffer.bytesused = frame.bytesused.value_or(all);
  return 0;
}

void* FakeV4l2::map(int fd, std::size_t length, std::int64_t offset, int& error) {
  const auto entry = open_.find(fd);
  error = -EINVAL;
  if (entry == open_.end()) return nullptr;
  FakeNode& node = nodes_[entry->second];
  const auto index = static_cast<std::size_t>(offset >> 12);
  if (index >= node.memory.size() || length > node.memory[index].size()) return nullptr;
  mapped_.insert(node.memory[index].data());
  return node.memory[index].data();
}

void FakeV4l2::unmap(void* memory, std::size_t) {
  if (mapped_.erase(memory) == 0) throw std::logic_error("unmapped what is not mapped");
}

int FakeV4l2::poll(std::span<pollfd> fds, std::int64_t deadline_ns) {
  ++polls;
  if (signal()) return -EINTR;
  FakeNode& node = nodes_.at(open_.at(fds[1].fd));
  fds[1].revents = node.extra_revents;
  if (node.gone) fds[1].revents = POLLERR | POLLHUP | POLLPRI;
  if (node.streaming && !node.frames.empty() && !node.queue.empty()) fds[1].revents |= POLLIN;
  if (!node.events.empty()) fds[1].revents |= POLLPRI;
  if (fds[1].revents != 0) return 1;
  time_ns = std::max(time_ns, deadline_ns);
  return 0;
}

}  // namespace loopd::testing
