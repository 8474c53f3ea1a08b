#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "base/result.h"
#include "capture/decode.h"

namespace loopd {

/// The file of a raw recording: what a camera gave, before anything looked at it.
///
/// A file header of 256 bytes, then one record a frame: a header of 64 bytes, `width * height`
/// bytes of luma (rows packed, top row first), and zeros up to the next multiple of 64. So every
/// header and every first pixel lies at a multiple of 64 bytes. All numbers are little-endian.
/// Checksums are the CRC-32 of zlib (and of gzip, PNG and Ethernet).
///
/// File header
///
///     offset size  what
///          0    8  "LOOPDREC"
///          8    4  version of this format: 1
///         12    4  size of this header: 256
///         16    8  CLOCK_REALTIME when the recording was started, ns since 1970, signed
///         24    8  CLOCK_MONOTONIC at the same moment, ns, signed
///         32    4  clock of the frames' times: 1 = CLOCK_MONOTONIC
///         36    4  0
///         40   40  boot id of the machine (its monotonic clock starts anew with each), text
///         80   64  name of the camera, UTF-8 text
///        144   64  version of the loopd that wrote it, text
///        208   44  0
///        252    4  CRC-32 of bytes 0..251
///
/// A text is padded with zeros; one that fills its field has none.
///
/// Frame header
///
///     offset size  what
///          0    8  "LOOPDFRM"
///          8    8  number of this frame in the file, from 0, without gaps
///         16    8  sequence number the camera gave it
///         24    8  capture time, ns, signed; 0 if there is none
///         32    4  width in pixels, 1..65535
///         36    4  height in pixels, 1..65535
///         40    4  flags: bit 0 = the capture time is known; a reader ignores the others
///         44    4  CRC-32 of the pixels
///         48    8  frames lost since the frame before, because the disk was too slow
///         56    4  0
///         60    4  CRC-32 of bytes 0..59
///
/// A file may end anywhere (power cut, full disk): it is good up to the last frame that has all its
/// pixels; the padding after them may be missing. A damaged header costs its frame: the next one
/// is found by its marker at a multiple of 64 bytes and its checksum, and its number tells how many
/// are missing. It is taken for a header only if its number is larger than the last good one's, by
/// no more than fits into the bytes between (a record has at least 128).
inline constexpr std::size_t kRecordingAlignment = 64;
inline constexpr std::size_t kRecordingFileHeaderBytes = 256;
inline constexpr std::size_t kRecordingFrameHeaderBytes = 64;
inline constexpr std::size_t kRecordingSmallestRecordBytes = 128;
inline constexpr std::uint32_t kRecordingVersion = 1;

/// What the file header says.
struct RecordingInfo {
  std::string camera = {};         ///< at most 64 bytes are kept
  std::string loopd_version = {};  ///< at most 64 bytes are kept
  std::string boot_id = {};        ///< /proc/sys/kernel/random/boot_id; at most 40 bytes are kept
  std::int64_t started_realtime_ns = 0;
  std::int64_t started_monotonic_ns = 0;
};

/// What a frame header says.
struct RecordedFrame {
  std::uint64_t number = 0;  ///< in the file
  std::uint64_t sequence = 0;
  std::optional<std::int64_t> time_ns = {};
  ImageSize size = {};
  std::uint64_t lost_before = 0;
  std::uint32_t pixels_crc = 0;
};

using RecordingFileHeader = std::array<std::uint8_t, kRecordingFileHeaderBytes>;
using RecordingFrameHeader = std::array<std::uint8_t, kRecordingFrameHeaderBytes>;

/// Bytes of a whole record: header, pixels, padding. Precondition: sides of at most 65535.
std::size_t recording_record_bytes(const ImageSize& size);

/// CRC-32 of `bytes` as in the file; 0.3 ms a megapixel on a common CPU.
std::uint32_t recording_crc(std::span<const std::uint8_t> bytes);

RecordingFileHeader encode_recording_info(const RecordingInfo& info);
RecordingFrameHeader encode_recorded_frame(const RecordedFrame& frame);

/// True if `start`, the first bytes of a file, announce a recording, of whatever version.
bool is_recording(std::span<const std::uint8_t> start);

/// Reads a file header; in its texts all but printable ASCII becomes '?'. Errors: one clause
/// without the file's name ("it is of version 7, ..."), with ENOTSUP for a version or clock unknown
/// here, else EBADMSG.
Result<RecordingInfo> decode_recording_info(std::span<const std::uint8_t> bytes);

/// Reads a frame header; none if marker, checksum or size are not those of one.
std::optional<RecordedFrame> decode_recorded_frame(
    std::span<const std::uint8_t, kRecordingFrameHeaderBytes> bytes);

}  // namespace loopd
