#pragma once

#include <cstdint>
#include <memory>

#include "base/clock.h"
#include "base/frame_pool.h"
#include "capture/camera.h"
#include "capture/capture_device.h"

namespace loopd {

/// The time in which a live camera waits and judges stamps; another one only in tests.
/// Thread: as the camera's next().
class LiveClock {
 public:
  virtual ~LiveClock() = default;
  virtual std::int64_t now_ns() const { return monotonic_now_ns(); }
  /// As Interrupt::wait_readable; `fd` -1 waits for the time alone.
  virtual Interrupt::Ready wait(const Interrupt& interrupt, int fd, std::int64_t deadline_ns) {
    return interrupt.wait_readable(fd, deadline_ns);
  }
};

/// A real camera: opens it by `driver`, turns its frames into luma, notices what goes wrong, and
/// gets it back.
///
/// No device at the start is fine: next() then answers as for a lost one. Loss: a `lost` error with
/// its cause, then next() re-opens with a back-off (at most half a second, and at once when the
/// driver's hotplug_fd() tells of a change); the first frame after it means that the camera is
/// back. While it stays away, the reason is told twice a second. Time-out: no frame for
/// max(1 s, 5 frame times) is kStalled (or what the device knows of the cause), and the device is
/// closed and opened again; so is one that for that long gives only damaged frames. A camera from
/// which nothing comes after opening is given twice as long each time, up to 4 s, and keeps that if
/// it turns out to need it.
///
/// Frames: the newest wins; those passed over, gaps in the driver's sequence, and frames for which
/// no buffer was free are counted by dropped(). Damaged, short and undecodable ones are errors
/// (kCorruptFrame) that cost that frame only; one with more pixels than a buffer holds is the loss
/// of the camera (kTooLarge), since all others are like it. Frame::sequence is the driver's, made
/// to grow without a step back over re-opening; with a driver whose sequence does not grow, it
/// counts what came. Frame::time_ns is the driver's stamp where it can be believed (not in the
/// future, not standing still or going back, not older than the stream), else the time at which the
/// frame came, with one notice a kind and opening; see restamped().
///
/// `pool` and `clock` must outlive the camera. Errors: none; all that can go wrong is told by
/// next().
std::unique_ptr<Camera> make_live_camera(std::unique_ptr<CaptureDriver> driver, FramePool& pool);
std::unique_ptr<Camera> make_live_camera(std::unique_ptr<CaptureDriver> driver, FramePool& pool,
                                         LiveClock& clock);

}  // namespace loopd
