#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "base/result.h"
#include "base/unique_fd.h"

namespace loopd {

/// Where the bytes of a recording go. An interface, so that tests can have a disk that is slow,
/// full or broken at will. Thread: one caller at a time.
class RecordingOutput {
 public:
  virtual ~RecordingOutput() = default;

  /// Appends all of `bytes`, or fails and leaves the end where it was. May take as long as the disk
  /// does. Errors: ENOSPC or EDQUOT if the disk is full, else what the system said.
  virtual Status append(std::span<const std::uint8_t> bytes) = 0;

  /// Brings everything to the disk. Nothing is appended after it.
  virtual Status finish() = 0;
};

/// An empty regular file, open for writing, as output.
///
/// Every 8 MiB, and every second, what was written is sent to the disk, and what was sent the time
/// before is waited for and then forgotten by the page cache: so a recording never holds more
/// than about 16 MiB and 2 s of the machine's memory (and of what a power cut costs, beside the
/// file system's own interval, 5 s on ext4). append() fails like a full disk before the file
/// system has less than `keep_free_bytes` left for others; with 0 it is filled to the last byte.
/// Errors: `file` is not regular, not empty, not writable, or appends by itself.
Result<std::unique_ptr<RecordingOutput>> open_recording_output(UniqueFd file,
                                                               std::uint64_t keep_free_bytes);

}  // namespace loopd
