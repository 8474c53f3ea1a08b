#pragma once

#include <memory>
#include <string>

#include "base/frame_pool.h"
#include "base/result.h"
#include "capture/camera.h"

namespace loopd {

/// How a folder of images, a recording or a video file stands in for a camera.
struct FileCameraOptions {
  /// A folder of images; a dataset folder (then its `images/` is used); one image; a raw recording
  /// (recording_format.h); or a video.
  /// In a folder every *.jpg, *.jpeg, *.png, *.pgm, *.ppm and *.pnm (any case) is a frame, sorted
  /// by name byte by byte; other names are ignored. What is in a file is decided by its content.
  std::string path = {};

  /// Frames per second in real time; 0 = as fast as possible, lock-step: next() waits for a free
  /// buffer and nothing is dropped. In real time each frame has an absolute deadline, so that the
  /// rate does not drift; a frame for which no buffer is free, or whose turn passed before next()
  /// was called, is dropped as by a real camera and counted. Range 0 .. 1000.
  double fps = 0;

  /// Start over at the end, without end. Sequence numbers and times go on growing.
  bool loop = false;

  /// 0-based index of the first frame to deliver; it must exist (a video or recording that is
  /// shorter just ends). The second lap starts at 0.
  int start = 0;

  /// Only for fps = 0 and where no other time is known: the rate from which times are made
  /// (sequence / nominal_fps). 0 = the rate of the video; for images no time. Range 0 .. 1000.
  double nominal_fps = 0;

  /// Scripted faults, separated by spaces or commas; see fault_script.h for the grammar.
  /// Example: "stall@100:2s drop@50:3 corrupt@70 unplug@200:5s jump@300:+3600s".
  std::string faults = {};

  /// Program that turns a video into frames; empty = `loopd-video` beside this executable, else in
  /// the installed libexec folder, else in PATH.
  std::string video_decoder = {};
};

/// Opens a folder of images, one image, a raw recording, or a video file as a camera.
///
/// Frames: Frame::sequence is the 0-based index in the folder or video and goes on growing when
/// looping. Frame::time_ns is, in real time, CLOCK_MONOTONIC at the frame's turn, before it is
/// decoded; in lock-step, from `times.txt` (in the given folder or beside the images), else from
/// a rate as above, else none. A recording has both as the camera gave them (in real time the
/// sequence number only); fault scripts count its frames from 0 all the same. stride_bytes =
/// width_px. Sizes may differ from frame to frame.
///
/// `times.txt`: one number a line for each image, in the same order; blank lines and lines that
/// start with # are skipped. Whole numbers whose median step is at least 100000 are nanoseconds;
/// everything else is seconds.
///
/// Decoding: JPEG, PNG, PGM and PPM, see decode.h. A frame with more pixels than
/// pool.bytes_each() is refused as kTooLarge. A frame that cannot be read costs that frame only.
///
/// A video is decoded by a child process (`loopd-video`), so that the daemon links no video
/// library (140 and more shared objects) and a hostile file can only kill the decoder: that ends
/// the stream with a kStreamError. The child is killed and reaped by the camera's destructor.
///
/// With fps = 0 the durations of stalls and of unplugging take no time: a stall appears in the
/// times only, and a camera unplugged for D answers D x 30 (one for each frame at 30 fps) calls
/// of next() with kNoDevice.
///
/// Errors: path missing or of a wrong kind, no images, bad times.txt, bad fault script (all
/// mistakes listed), options out of range, video not decodable.
Result<std::unique_ptr<Camera>> open_file_camera(const FileCameraOptions& options, FramePool& pool);

}  // namespace loopd
