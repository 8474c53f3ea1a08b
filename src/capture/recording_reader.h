#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/unique_fd.h"
#include "capture/recording_format.h"

namespace loopd {

/// Reads the frames of a recording (see recording_format.h) one after the other, also while it is
/// still being written: a frame that is not yet whole is the end, and may be there at the next
/// call. Plain reads, no mapping: a file that somebody cuts short meanwhile is an error, no signal.
///
/// Memory: 64 KiB for the search after damage, taken at the first one. Thread: one caller at a
/// time.
class RecordingReader {
 public:
  /// Opens `path` and reads its header. `stop` ends a search through a large damaged stretch early.
  /// Errors: not a regular file, not a recording, of another version, damaged header.
  static Result<RecordingReader> open(const std::string& path, std::stop_token stop);

  const RecordingInfo& info() const { return info_; }

  /// The next whole frame by its header; none at the end, or once `stop` is requested. Damage
  /// shows as a gap in RecordedFrame::number, damage behind the last whole frame does not show.
  /// Errors: the file cannot be read (the disk failed).
  Result<std::optional<RecordedFrame>> next();

  /// Reads the pixels of the frame next() gave, which `luma` must have room for. Errors: EBADMSG if
  /// they are damaged or not there any more, else why reading failed. Then `luma` holds anything.
  Status read_pixels(std::span<std::uint8_t> luma) const;

  /// Goes back to the first frame.
  void rewind();

 private:
  RecordingReader(UniqueFd file, std::string path, RecordingInfo info, std::stop_token stop);

  struct Found {
    RecordedFrame frame;
    std::uint64_t at = 0;
  };
  Result<std::optional<Found>> find();
  std::optional<RecordedFrame> acceptable(std::span<const std::uint8_t> header,
                                          std::uint64_t at) const;
  Result<std::size_t> read_at(std::uint64_t at, std::span<std::uint8_t> bytes) const;

  UniqueFd file_;
  std::string path_;
  RecordingInfo info_;
  std::stop_token stop_;
  std::vector<std::uint8_t> block_;                     ///< of a search
  std::uint64_t position_ = kRecordingFileHeaderBytes;  ///< behind the last frame given
  std::uint64_t next_number_ = 0;                       ///< of the frame that should be there
  RecordedFrame frame_;                                 ///< the last frame given
  std::uint64_t pixels_at_ = 0;
};

}  // namespace loopd
