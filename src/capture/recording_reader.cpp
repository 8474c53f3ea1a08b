#include "capture/recording_reader.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cassert>
#include <cerrno>
#include <utility>

namespace loopd {
namespace {

constexpr std::size_t kSearchBlockBytes = 64u << 10;

Error cannot_open(const std::string& path, const std::string& cause, int code) {
  return {"cannot open the recording " + path + ": " + cause, code};
}

// O_NONBLOCK: opening a pipe or a device must not wait for its other side.
Result<UniqueFd> open_regular(const std::string& path) {
  UniqueFd file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!file.valid()) return errno_error("cannot open the recording " + path, errno);
  struct stat status {};
  if (::fstat(file.get(), &status) != 0)
    return errno_error("cannot open the recording " + path, errno);
  if (!S_ISREG(status.st_mode)) return cannot_open(path, "it is not a regular file", ENOTSUP);
  ::posix_fadvise(file.get(), 0, 0, POSIX_FADV_SEQUENTIAL);
  return file;
}

// Reads until `bytes` is full or the file ends; how many, or the errno of a failure.
Result<std::size_t> read_fully(int file, std::uint64_t at, std::span<std::uint8_t> bytes) {
  std::size_t length = 0;
  while (length < bytes.size()) {
    const ssize_t got = ::pread(file, bytes.data() + length, bytes.size() - length,
                                static_cast<off_t>(at + length));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return errno_error("reading fails", errno);
    if (got == 0) break;
    length += static_cast<std::size_t>(got);
  }
  return length;
}

}  // namespace

RecordingReader::RecordingReader(UniqueFd file, std::string path, RecordingInfo info,
                                 std::stop_token stop)
    : file_(std::move(file)),
      path_(std::move(path)),
      info_(std::move(info)),
      stop_(std::move(stop)) {}

Result<RecordingReader> RecordingReader::open(const std::string& path, std::stop_token stop) {
  Result<UniqueFd> file = open_regular(path);
  if (!file.ok()) return file.error();
  RecordingFileHeader header{};
  const Result<std::size_t> got = read_fully(file->get(), 0, header);
  if (!got.ok()) return cannot_open(path, got.error().message, got.error().code);
  Result<RecordingInfo> info = decode_recording_info(std::span(header).first(got.value()));
  if (!info.ok()) return cannot_open(path, info.error().message, info.error().code);
  return RecordingReader(std::move(file).value(), path, std::move(info).value(), std::move(stop));
}

Result<std::optional<RecordedFrame>> RecordingReader::next() {
  const Result<std::optional<Found>> found = find();
  if (!found.ok()) return found.error();
  if (!found.value()) return std::optional<RecordedFrame>();
  const auto& [frame, at] = *found.value();
  struct stat status {};
  if (::fstat(file_.get(), &status) != 0) return errno_error("cannot read " + path_, errno);
  pixels_at_ = at + kRecordingFrameHeaderBytes;
  if (pixels_at_ + frame.size.pixels() > static_cast<std::uint64_t>(status.st_size))
    return std::optional<RecordedFrame>();  // cut short, or still being written
  frame_ = frame;
  position_ = at + recording_record_bytes(frame.size);
  next_number_ = frame.number + 1;
  return std::optional(frame);
}

// The header where it should be, or the first acceptable one behind that place.
Result<std::optional<RecordingReader::Found>> RecordingReader::find() {
  RecordingFrameHeader header{};
  const Result<std::size_t> got = read_at(position_, header);
  if (!got.ok()) return got.error();
  if (got.value() < header.size()) return std::optional<Found>();
  if (const auto frame = acceptable(header, position_))
    return std::optional(Found{*frame, position_});

  block_.resize(kSearchBlockBytes);
  for (std::uint64_t at = position_; !stop_.stop_requested(); at += block_.size()) {
    const Result<std::size_t> filled = read_at(at, block_);
    if (!filled.ok()) return filled.error();
    for (std::size_t i = 0; i + kRecordingFrameHeaderBytes <= filled.value();
         i += kRecordingAlignment)
      if (const auto frame = acceptable(std::span(block_).subspan(i), at + i))
        return std::optional(Found{*frame, at + i});
    if (filled.value() < block_.size()) break;
  }
  return std::optional<Found>();
}

// Neither an older frame nor one with more frames before it than the bytes between can hold: so
// nobody's pixels, and no hostile file, can make the reader count through endless missing frames.
std::optional<RecordedFrame> RecordingReader::acceptable(std::span<const std::uint8_t> header,
                                                         std::uint64_t at) const {
  const auto frame = decode_recorded_frame(header.first<kRecordingFrameHeaderBytes>());
  if (!frame) return std::nullopt;
  // Unsigned: an older number gives a difference larger than any file.
  if (frame->number - next_number_ > (at - position_) / kRecordingSmallestRecordBytes)
    return std::nullopt;
  return frame;
}

Result<std::size_t> RecordingReader::read_at(std::uint64_t at,
                                             std::span<std::uint8_t> bytes) const {
  Result<std::size_t> got = read_fully(file_.get(), at, bytes);
  if (!got.ok())
    return Error{"cannot read " + path_ + ": " + got.error().message, got.error().code};
  return got;
}

Status RecordingReader::read_pixels(std::span<std::uint8_t> luma) const {
  assert(luma.size() >= frame_.size.pixels());
  const std::span<std::uint8_t> pixels = luma.first(frame_.size.pixels());
  const Result<std::size_t> got = read_at(pixels_at_, pixels);
  if (!got.ok()) return got.error();
  const std::string what = "cannot read frame " + std::to_string(frame_.number) + " of " + path_;
  if (got.value() < pixels.size()) return Error{what + ": the file was cut short", EBADMSG};
  if (recording_crc(pixels) != frame_.pixels_crc)
    return Error{what + ": its pixels are damaged", EBADMSG};
  return Nothing{};
}

void RecordingReader::rewind() {
  position_ = kRecordingFileHeaderBytes;
  next_number_ = 0;
}

}  // namespace loopd
