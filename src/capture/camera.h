#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>

#include "loopd/frame.h"

namespace loopd {

/// What went wrong with a camera or with one of its frames.
enum class CameraFault : std::uint8_t {
  kNoDevice,      ///< the device is not there (yet, or not again)
  kPermission,    ///< it is there, but this process may not use it
  kBusy,          ///< it is there, but another process streams from it
  kUnsupported,   ///< a format, or kind of file, that cannot be read
  kCorruptFrame,  ///< the data of one frame is damaged or incomplete
  kTooLarge,      ///< one frame has more pixels than the configured maximum
  kStalled,       ///< no frame came for max(1 s, 5 frame times)
  kNoSignal,      ///< the device works, but nothing (or nothing it can lock on) is connected to it
  kUnplugged,     ///< the device went away while in use
  kStreamError,   ///< reading failed for another reason; the message and code say which
};

/// Stable lower-case name, as in logs and in events: "no_device", "permission", "busy",
/// "unsupported", "corrupt_frame", "too_large", "stalled", "no_signal", "unplugged",
/// "stream_error".
std::string_view camera_fault_name(CameraFault fault);

/// A named failure of a camera, or of one frame of it.
struct CameraError {
  CameraFault fault = CameraFault::kStreamError;
  std::string message;  ///< one sentence: what was tried, on what, why it failed, the remedy
  int code = 0;         ///< errno behind it, 0 if none
  /// True: the camera is gone until it comes back; keep calling next(), which tries to get it back.
  /// False: only this frame is lost; the next one may be fine.
  bool lost = false;
  std::uint64_t sequence = 0;  ///< of the frame concerned, or of the next one if none is
};

/// Something worth telling that costs no frame.
struct CameraNotice {
  enum class Kind : std::uint8_t {
    kOpened,       ///< the device was opened (again); which one, and with which format
    kOtherCamera,  ///< it is not the camera that was there before
    kTimeStamps,   ///< the driver's time stamps cannot be used; what replaces them
    kSettings,     ///< something that was asked for could not be had; the camera works without it
  };
  Kind kind = Kind::kOpened;
  std::string message;  ///< one sentence
};

/// The source has no more frames; every later next() returns this too.
struct EndOfStream {};

/// interrupt() was called; every later next() returns this too.
struct Interrupted {};

using CameraEvent = std::variant<Frame, CameraError, CameraNotice, EndOfStream, Interrupted>;

/// A source of luma frames whose buffers come from a FramePool, which must outlive the camera.
///
/// A lost camera needs no new object: next() tries to re-open it. While it is away, a call waits
/// up to half a second (only where time is real) and then returns a `lost` error again, so a
/// caller may loop over next() without sleeping of its own. The first frame after a loss means
/// that the camera is back.
///
/// Thread: next() and describe() by one thread at a time; interrupt(), dropped() and restamped() by
/// any thread (interrupt() is not for signal handlers). Destroy it when no call is running.
class Camera {
 public:
  virtual ~Camera() = default;

  /// Blocks until there is a frame, an error, a notice, the end or an interrupt. Never throws for
  /// what the source delivers.
  virtual CameraEvent next() = 0;

  /// Ends the camera for good: a next() that is blocked, and every later one, returns Interrupted
  /// promptly (a decode in progress is finished first).
  virtual void interrupt() = 0;

  /// One line for logs, such as "folder of 84 images, the first 512x384, as fast as possible".
  virtual std::string describe() const = 0;

  /// Frames that the source had, but that were never delivered: no buffer was free, next() was
  /// called too late, or the driver skipped them. Corrupt frames are errors and not counted here.
  virtual std::uint64_t dropped() const { return 0; }

  /// Frames whose time stamp could not be believed (none, in the future, standing still, going
  /// back, or older than the stream) and was replaced by the time at which the frame came.
  virtual std::uint64_t restamped() const { return 0; }
};

}  // namespace loopd
