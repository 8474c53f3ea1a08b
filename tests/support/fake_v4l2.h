#pragma once

#include <linux/videodev2.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "capture/v4l2_io.h"

namespace loopd::testing {

/// A frame that a fake camera has ready.
struct FakeFrame {
  std::uint32_t sequence = 0;
  std::int64_t time_us = 0;
  std::uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  std::uint8_t value = 0;                    ///< of every byte
  std::optional<std::uint32_t> bytesused{};  ///< none: all
};

/// One video node of the fake kernel, and everything that a test may want to be otherwise.
struct FakeNode {
  std::string card = "Fake Camera";
  std::uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  struct Size {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::vector<std::uint32_t> fps;
  };
  struct Format {
    std::uint32_t fourcc = 0;
    std::vector<Size> sizes;
  };
  std::vector<Format> formats{{V4L2_PIX_FMT_YUYV, {{8, 4, {30, 15}}}}};
  bool endless = false;  ///< every list of formats, sizes and rates goes on for ever
  std::optional<std::uint32_t> input_status;
  std::optional<int> dv_timings;  ///< what QUERY_DV_TIMINGS answers, on an input that has timings
  struct Control {
    std::string name;
    std::int32_t least = 0;
    std::int32_t most = 0;
    std::int32_t value = 0;
    std::uint32_t flags = 0;
    int refusal = 0;
  };
  std::vector<Control> controls;
  bool exports = true;

  std::deque<FakeFrame> frames;      ///< ready to be dequeued, if buffers are queued
  std::deque<std::uint32_t> events;  ///< changes of the source
  short extra_revents = 0;
  bool gone = false;  ///< unplugged: ENODEV for all there is
  bool busy = false;  ///< another program streams
  /// The answer to a request instead of the usual one; erased after `times` uses (-1: never).
  struct Fault {
    int result = 0;
    int times = 1;
  };
  std::map<unsigned long, Fault> faults;
  /// Changes what a request answered, after it succeeded.
  std::function<void(unsigned long, void*)> lie;

  // What became of it.
  v4l2_format format{};
  std::uint32_t fps = 30;
  std::vector<std::vector<std::uint8_t>> memory;
  std::vector<bool> queued;
  std::deque<std::uint32_t> queue;
  bool streaming = false;
  int syncs = 0;
  int requeued = 0;
};

/// A kernel with video nodes. It counts descriptors and mappings, so that a test sees what leaks.
/// Its clock stands still but for a poll, which moves it to its deadline if nothing is ready.
class FakeV4l2 : public V4l2Io {
 public:
  FakeNode& node(const std::string& path) { return nodes_[path]; }
  void remove(const std::string& path) { nodes_.erase(path); }

  int open(const std::string& path) override;
  void close(int fd) override;
  int ioctl(int fd, unsigned long request, void* argument) override;
  void* map(int fd, std::size_t length, std::int64_t offset, int& error) override;
  void unmap(void* memory, std::size_t length) override;
  int poll(std::span<pollfd> fds, std::int64_t deadline_ns) override;
  std::int64_t now_ns() override { return time_ns; }

  int descriptors() const { return static_cast<int>(open_.size() + exported_.size()); }
  int mappings() const { return static_cast<int>(mapped_.size()); }

  std::int64_t time_ns = 1'000'000'000;
  bool interrupted = false;  ///< every second call fails with EINTR
  std::map<std::string, int> open_results;
  long calls = 0;
  long polls = 0;
  std::set<unsigned long> requests;  ///< all that were ever made

 private:
  int usual(FakeNode& node, unsigned long request, void* argument);
  int list(FakeNode& node, unsigned long request, void* argument);
  int control(FakeNode& node, unsigned long request, void* argument);
  int buffer(FakeNode& node, unsigned long request, void* argument);
  int dequeue(FakeNode& node, v4l2_buffer& buffer);
  int set_format(FakeNode& node, v4l2_format& format);
  bool signal();

  std::map<std::string, FakeNode> nodes_;
  std::map<int, std::string> open_;
  std::set<int> exported_;
  std::set<void*> mapped_;
  int next_fd_ = 1000;
  long interruptions_ = 0;
};

}  // namespace loopd::testing
