#pragma once

#include <libcamera/camera.h>
#include <libcamera/framebuffer_allocator.h>
#include <libcamera/request.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "capture/capture_device.h"
#include "capture/libcamera_clock.h"
#include "capture/libcamera_completions.h"
#include "capture/libcamera_dev_watch.h"
#include "capture/libcamera_driver.h"
#include "capture/libcamera_frames.h"
#include "capture/libcamera_manager.h"

namespace loopd {

/// A camera of libcamera that streams: one stream, one request a buffer, all of them queued but
/// those that are done and the one whose frame is out.
///
/// libcamera's signals arrive on its own threads and do nothing but set bits of a CompletionBoard;
/// all else happens in the calls of CaptureDevice, on the caller's thread.
///
/// Unplugging is told by libcamera's signal where udev's messages arrive. They may not (a private
/// network), so the nodes of the camera are watched too, and looked at when no frame came in time.
class LibcameraDevice final : public CaptureDevice {
 public:
  /// Takes the camera and starts its stream. `watch` was made before the cameras were enumerated.
  static CaptureDriver::Opened open(std::shared_ptr<LibcameraManager> manager,
                                    std::shared_ptr<libcamera::Camera> camera, DevWatch watch,
                                    const LibcameraOptions& options);

  ~LibcameraDevice() override;
  LibcameraDevice(const LibcameraDevice&) = delete;
  LibcameraDevice& operator=(const LibcameraDevice&) = delete;

  Grab grab(const Interrupt& interrupt, std::int64_t deadline_ns) override;
  void release() override;
  const DeviceInfo& info() const override { return info_; }

 private:
  using Problem = std::optional<CameraError>;

  LibcameraDevice(std::shared_ptr<LibcameraManager> manager,
                  std::shared_ptr<libcamera::Camera> camera, DevWatch watch);

  // The steps of open(), in order.
  Problem acquire();
  Problem choose(const LibcameraOptions& options);
  Problem configure(const LibcameraOptions& options);
  Problem allocate();
  Problem start(const LibcameraOptions& options);

  // The steps of grab().
  enum class Wait : std::uint8_t { kSomething, kNothing, kInterrupted };
  Wait wait(const Interrupt& interrupt, std::int64_t deadline_ns);
  std::optional<RawFrame> newest_frame();
  std::optional<std::size_t> better(std::optional<std::size_t> best, std::size_t next,
                                    std::uint64_t& passed_over);
  RawFrame read(std::size_t index);
  Grab nothing_came();

  void on_completed(libcamera::Request* request);  // by libcamera's thread
  void on_disconnected();                          // by libcamera's thread

  const libcamera::FrameMetadata& metadata(std::size_t index) const;
  bool intact(std::size_t index) const;
  void requeue(std::size_t index);
  void withdraw(int status);
  bool has_gone() const;
  bool nodes_present() const;
  CameraError failed(const std::string& what, int status) const;
  CameraError unplugged() const;

  std::shared_ptr<LibcameraManager> manager_;
  std::shared_ptr<libcamera::Camera> camera_;
  std::unique_ptr<libcamera::CameraConfiguration> config_;
  std::unique_ptr<libcamera::FrameBufferAllocator> allocator_;
  std::vector<MappedPlane> planes_;
  std::vector<std::unique_ptr<libcamera::Request>> requests_;  ///< cookie = index = its buffer's
  bool acquired_ = false;
  bool started_ = false;

  CompletionBoard board_;
  DevWatch watch_;
  std::vector<CameraNode> nodes_;
  std::vector<std::string> node_names_;
  bool usb_ = false;
  StampClock clock_;
  FrameLayout layout_;
  DeviceInfo info_;
  std::optional<std::size_t> held_;  ///< whose frame is out
  std::optional<std::uint32_t> last_sequence_;
  std::size_t queued_ = 0;  ///< requests that libcamera has
  std::optional<CameraError> lost_;
};

}  // namespace loopd
