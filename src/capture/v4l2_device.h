#pragma once

#include <memory>
#include <string>

#include "capture/capture_device.h"
#include "capture/v4l2_buffers.h"
#include "capture/v4l2_driver.h"
#include "capture/v4l2_io.h"
#include "capture/v4l2_setup.h"

namespace loopd {

/// A V4L2 node that streams. Thread: one caller at a time.
class V4l2Device final : public CaptureDevice {
 public:
  /// Opens `path` ("/dev/video0", no link), sets it up and starts its stream.
  static CaptureDriver::Opened open(const V4l2Options& options, V4l2Io& io, const V4l2Paths& paths,
                                    const std::string& path);
  ~V4l2Device() override;

  Grab grab(const Interrupt& interrupt, std::int64_t deadline_ns) override;
  void release() override;
  const DeviceInfo& info() const override { return info_; }

 private:
  V4l2Device(V4l2Node node, const V4l2Paths& paths, std::string path)
      : node_(std::move(node)), paths_(paths), path_(std::move(path)) {}

  V4l2Context context() const { return {node_, paths_, path_}; }
  std::optional<CameraError> set_up(const V4l2Options& options);
  std::optional<CameraError> start(int buffers);
  void describe(const V4l2Capability& capability);
  void note_clock(std::uint32_t flags);

  Grab grab_newest(short happened);
  Grab failed(int result) const;
  Grab nothing_came() const;
  std::optional<CameraError> handle_events(short happened) const;
  RawFrame raw_frame(const V4l2Buffers::Filled& filled, std::uint64_t passed_over);

  V4l2Node node_;
  const V4l2Paths paths_;
  const std::string path_;
  DeviceInfo info_;
  std::uint32_t type_ = 0;
  V4l2Stream stream_;
  std::unique_ptr<V4l2Buffers> buffers_;  ///< after node_, so that it goes before it
  bool streaming_ = false;
  std::optional<std::size_t> out_;  ///< the buffer lent by the last grab()
};

}  // namespace loopd
