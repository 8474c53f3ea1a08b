#include "capture/recording_format.h"

#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>

namespace loopd {
namespace {

constexpr std::string_view kFileMagic = "LOOPDREC";
constexpr std::string_view kFrameMarker = "LOOPDFRM";
constexpr std::uint32_t kClockMonotonic = 1;
constexpr std::uint32_t kFlagTime = 1;
constexpr std::uint32_t kMaxSide_px = 65535;

constexpr std::size_t kBootIdAt = 40;
constexpr std::size_t kBootIdBytes = 40;
constexpr std::size_t kCameraAt = 80;
constexpr std::size_t kLoopdVersionAt = 144;
constexpr std::size_t kNameBytes = 64;

// Little-endian whatever the CPU.
template <class T>
void put(std::span<std::uint8_t> bytes, std::size_t at, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i)
    bytes[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
}

template <class T>
T get(std::span<const std::uint8_t> bytes, std::size_t at) {
  T value = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i)
    value = static_cast<T>(value | static_cast<T>(bytes[at + i]) << (8 * i));
  return value;
}

void put_text(std::span<std::uint8_t> field, std::string_view text) {
  std::copy_n(text.begin(), std::min(text.size(), field.size()), field.begin());
}

// What a file calls itself goes to logs and clients: nothing but printable ASCII gets through.
std::string get_text(std::span<const std::uint8_t> field) {
  std::string text(field.begin(), std::find(field.begin(), field.end(), std::uint8_t{0}));
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return text;
}

bool starts_with(std::span<const std::uint8_t> bytes, std::string_view text) {
  return bytes.size() >= text.size() && std::memcmp(bytes.data(), text.data(), text.size()) == 0;
}

// The last four bytes of a header are the checksum of the others.
void seal(std::span<std::uint8_t> header) {
  put(header, header.size() - 4, recording_crc(header.first(header.size() - 4)));
}

bool is_sealed(std::span<const std::uint8_t> header) {
  return get<std::uint32_t>(header, header.size() - 4) ==
         recording_crc(header.first(header.size() - 4));
}

}  // namespace

std::size_t recording_record_bytes(const ImageSize& size) {
  const std::size_t bytes = kRecordingFrameHeaderBytes + size.pixels();
  return (bytes + kRecordingAlignment - 1) / kRecordingAlignment * kRecordingAlignment;
}

std::uint32_t recording_crc(std::span<const std::uint8_t> bytes) {
  return static_cast<std::uint32_t>(::crc32_z(0, bytes.data(), bytes.size()));
}

RecordingFileHeader encode_recording_info(const RecordingInfo& info) {
  RecordingFileHeader bytes{};
  const std::span<std::uint8_t> out = bytes;
  put_text(out, kFileMagic);
  put<std::uint32_t>(out, 8, kRecordingVersion);
  put<std::uint32_t>(out, 12, kRecordingFileHeaderBytes);
  put(out, 16, static_cast<std::uint64_t>(info.started_realtime_ns));
  put(out, 24, static_cast<std::uint64_t>(info.started_monotonic_ns));
  put<std::uint32_t>(out, 32, kClockMonotonic);
  put_text(out.subspan(kBootIdAt, kBootIdBytes), info.boot_id);
  put_text(out.subspan(kCameraAt, kNameBytes), info.camera);
  put_text(out.subspan(kLoopdVersionAt, kNameBytes), info.loopd_version);
  seal(out);
  return bytes;
}

RecordingFrameHeader encode_recorded_frame(const RecordedFrame& frame) {
  RecordingFrameHeader bytes{};
  const std::span<std::uint8_t> out = bytes;
  put_text(out, kFrameMarker);
  put(out, 8, frame.number);
  put(out, 16, frame.sequence);
  put(out, 24, static_cast<std::uint64_t>(frame.time_ns.value_or(0)));
  put(out, 32, static_cast<std::uint32_t>(frame.size.width_px));
  put(out, 36, static_cast<std::uint32_t>(frame.size.height_px));
  put<std::uint32_t>(out, 40, frame.time_ns ? kFlagTime : 0);
  put(out, 44, frame.pixels_crc);
  put(out, 48, frame.lost_before);
  seal(out);
  return bytes;
}

bool is_recording(std::span<const std::uint8_t> start) { return starts_with(start, kFileMagic); }

Result<RecordingInfo> decode_recording_info(std::span<const std::uint8_t> bytes) {
  if (!is_recording(bytes)) return Error{"it is no recording of loopd", EBADMSG};
  if (bytes.size() < kRecordingFileHeaderBytes)
    return Error{"it ends within its header and holds no frame", EBADMSG};
  const auto version = get<std::uint32_t>(bytes, 8);
  if (version != kRecordingVersion)
    return Error{"it is of version " + std::to_string(version) + ", and this loopd reads version " +
                     std::to_string(kRecordingVersion) + "; use the loopd that wrote it",
                 ENOTSUP};
  const auto header = bytes.first(kRecordingFileHeaderBytes);
  if (!is_sealed(header) || get<std::uint32_t>(bytes, 12) != kRecordingFileHeaderBytes)
    return Error{"its header is damaged", EBADMSG};
  if (get<std::uint32_t>(bytes, 32) != kClockMonotonic)
    return Error{"its times are of a clock that this loopd does not know", ENOTSUP};
  return RecordingInfo{
      .camera = get_text(header.subspan(kCameraAt, kNameBytes)),
      .loopd_version = get_text(header.subspan(kLoopdVersionAt, kNameBytes)),
      .boot_id = get_text(header.subspan(kBootIdAt, kBootIdBytes)),
      .started_realtime_ns = static_cast<std::int64_t>(get<std::uint64_t>(bytes, 16)),
      .started_monotonic_ns = static_cast<std::int64_t>(get<std::uint64_t>(bytes, 24)),
  };
}

std::optional<RecordedFrame> decode_recorded_frame(
    std::span<const std::uint8_t, kRecordingFrameHeaderBytes> bytes) {
  if (!starts_with(bytes, kFrameMarker) || !is_sealed(bytes)) return std::nullopt;
  const auto width = get<std::uint32_t>(bytes, 32);
  const auto height = get<std::uint32_t>(bytes, 36);
  if (width == 0 || height == 0 || width > kMaxSide_px || height > kMaxSide_px) return std::nullopt;
  RecordedFrame frame;
  frame.number = get<std::uint64_t>(bytes, 8);
  frame.sequence = get<std::uint64_t>(bytes, 16);
  if ((get<std::uint32_t>(bytes, 40) & kFlagTime) != 0)
    frame.time_ns = static_cast<std::int64_t>(get<std::uint64_t>(bytes, 24));
  frame.size = {static_cast<int>(width), static_cast<int>(height)};
  frame.lost_before = get<std::uint64_t>(bytes, 48);
  frame.pixels_crc = get<std::uint32_t>(bytes, 44);
  return frame;
}

}  // namespace loopd
