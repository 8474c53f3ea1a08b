#include "capture/recording_source.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "capture/fault_script.h"
#include "capture/recording_reader.h"

namespace loopd {
namespace {

// How far one lap goes in numbers, sequence numbers and time.
class Lap {
 public:
  void add(const RecordedFrame& frame) {
    frames_ = frame.number + 1;
    lowest_sequence_ = std::min(lowest_sequence_, frame.sequence);
    highest_sequence_ = std::max(highest_sequence_, frame.sequence);
    if (!frame.time_ns) return;
    if (timed_++ == 0) first_ns_ = *frame.time_ns;
    last_ns_ = *frame.time_ns;
  }

  std::uint64_t frames() const { return frames_; }
  std::uint64_t sequences() const { return highest_sequence_ - lowest_sequence_ + 1; }

  // From the first frame's time to where the next lap's first would be, one mean step later. 0 if
  // times go backwards or span centuries: they stay as they are.
  std::int64_t span_ns() const {
    std::int64_t span = 0;
    if (timed_ < 2 || __builtin_sub_overflow(last_ns_, first_ns_, &span)) return 0;
    return std::max<std::int64_t>(0, saturating_add(span, span / (timed_ - 1)));
  }

 private:
  std::uint64_t frames_ = 0;  ///< damaged ones included
  std::uint64_t lowest_sequence_ = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t highest_sequence_ = 0;
  std::int64_t timed_ = 0;
  std::int64_t first_ns_ = 0;
  std::int64_t last_ns_ = 0;
};

class RecordingSource : public FrameSource {
 public:
  RecordingSource(SourceOptions options, RecordingReader reader, std::string description,
                  const Interrupt& interrupt)
      : options_(std::move(options)),
        reader_(std::move(reader)),
        description_(std::move(description)),
        interrupt_(&interrupt) {}

  Prepared prepare(std::uint64_t number, bool corrupt) override {
    while (!ended_ && (!frame_ || frame_->number < number - lap_start_)) {
      const Result<std::optional<RecordedFrame>> next = reader_.next();
      if (interrupt_->requested()) return Interrupted{};
      if (!next.ok()) return end_by(next.error(), number);
      if (next.value())
        take(*next.value());
      else
        end_lap(number);
    }
    if (ended_) return EndOfStream{};
    if (frame_->number > number - lap_start_) return lose(number, "its header is damaged");
    if (corrupt) return lose(number, "it is damaged by the fault script");
    if (frame_->size.pixels() > options_.max_pixels) return too_large(number);
    return frame_->size;
  }

  std::optional<CameraError> decode(std::span<std::uint8_t> luma) override {
    const Status status = reader_.read_pixels(luma);
    if (status.ok()) {
      bad_in_row_ = 0;
      return std::nullopt;
    }
    ++bad_in_row_;
    const int code = status.error().code;
    return CameraError{code == EBADMSG ? CameraFault::kCorruptFrame : CameraFault::kStreamError,
                       status.error().message, code, false,
                       camera_sequence(lap_start_ + frame_->number)};
  }

  std::optional<std::int64_t> time_ns(std::uint64_t number) const override {
    if (frame_ && frame_->time_ns) return saturating_add(*frame_->time_ns, time_offset_ns_);
    if (options_.nominal_fps > 0)
      return std::llround(static_cast<double>(number) * 1e9 / options_.nominal_fps);
    return std::nullopt;
  }

  // Exact for the prepared frame; for others as if the camera had counted on without gaps.
  std::uint64_t camera_sequence(std::uint64_t number) const override {
    if (!frame_) return number;
    return frame_->sequence + sequence_offset_ + (number - lap_start_ - frame_->number);
  }

  std::uint64_t length() const override { return 0; }

  std::string describe() const override { return description_; }

 private:
  void take(const RecordedFrame& frame) {
    frame_ = frame;
    lap_.add(frame);
  }

  // Starts the lap that holds `number`, unless this was the last or would go on failing for ever.
  void end_lap(std::uint64_t number) {
    const std::uint64_t frames = lap_.frames();
    ended_ = !options_.loop || frames == 0 || bad_in_row_ >= frames;
    if (ended_) return;
    const std::uint64_t laps = (number - lap_start_) / frames;
    lap_start_ += laps * frames;
    sequence_offset_ += laps * lap_.sequences();
    std::int64_t passed_ns = 0;
    if (__builtin_mul_overflow(lap_.span_ns(), laps, &passed_ns))
      passed_ns = std::numeric_limits<std::int64_t>::max();
    time_offset_ns_ = saturating_add(time_offset_ns_, passed_ns);
    lap_ = Lap();
    frame_.reset();
    reader_.rewind();
  }

  std::string frame_text(std::uint64_t number) const {
    return "cannot read frame " + std::to_string(number - lap_start_) + " of " + options_.path;
  }

  CameraError lose(std::uint64_t number, const std::string& cause) {
    ++bad_in_row_;
    return {CameraFault::kCorruptFrame, frame_text(number) + ": " + cause, EBADMSG, false,
            camera_sequence(number)};
  }

  CameraError too_large(std::uint64_t number) {
    ++bad_in_row_;
    return {CameraFault::kTooLarge,
            frame_text(number) + ": it is " + std::to_string(frame_->size.width_px) + "x" +
                std::to_string(frame_->size.height_px) + ", more than the " +
                std::to_string(options_.max_pixels) + " pixels of camera.max_pixels",
            EFBIG, false, camera_sequence(number)};
  }

  // A disk that fails is not asked again.
  CameraError end_by(const Error& error, std::uint64_t number) {
    ended_ = true;
    return {CameraFault::kStreamError, error.message, error.code, false, camera_sequence(number)};
  }

  const SourceOptions options_;
  RecordingReader reader_;
  const std::string description_;
  const Interrupt* interrupt_;
  std::optional<RecordedFrame> frame_;  ///< the last one the reader found in this lap
  Lap lap_;                             ///< this one, as far as it was read
  std::uint64_t lap_start_ = 0;         ///< number of this lap's first frame, counted over all laps
  std::uint64_t sequence_offset_ = 0;   ///< of this lap
  std::int64_t time_offset_ns_ = 0;     ///< of this lap
  std::uint64_t bad_in_row_ = 0;
  bool ended_ = false;
};

std::string describe_recording(const RecordingInfo& info, const std::optional<RecordedFrame>& first,
                               const std::string& path) {
  std::string text = "recording";
  if (!info.camera.empty()) text += " of camera " + info.camera;
  if (!first) return text + ", without a frame so far, " + path;
  return text + ", the first frame " + std::to_string(first->size.width_px) + "x" +
         std::to_string(first->size.height_px) + (first->time_ns ? ", with times, " : ", ") + path;
}

}  // namespace

Result<std::unique_ptr<FrameSource>> open_recording_source(const SourceOptions& options,
                                                           const Interrupt& interrupt) {
  Result<RecordingReader> reader = RecordingReader::open(options.path, interrupt.token());
  if (!reader.ok()) return reader.error();
  const Result<std::optional<RecordedFrame>> first = reader->next();
  if (!first.ok()) return first.error();
  reader->rewind();
  std::string description = describe_recording(reader->info(), first.value(), options.path);
  return std::unique_ptr<FrameSource>(std::make_unique<RecordingSource>(
      options, std::move(reader).value(), std::move(description), interrupt));
}

}  // namespace loopd
