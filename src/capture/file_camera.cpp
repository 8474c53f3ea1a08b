#include "capture/file_camera.h"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <optional>
#include <span>
#include <utility>

#include "base/clock.h"
#include "capture/decode.h"
#include "capture/fault_script.h"
#include "capture/folder_source.h"
#include "capture/interrupt.h"
#include "capture/recording_format.h"
#include "capture/recording_source.h"
#include "capture/video_source.h"

namespace loopd {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kRetry_ns = kSecond_ns / 2;
constexpr double kSimulatedFps = 30;
constexpr double kMaxFps = 1000;

// The time in which a camera lives: the monotonic clock, or one that a wait simply moves on.
class CaptureClock {
 public:
  CaptureClock(bool real, const Interrupt& interrupt) : real_(real), interrupt_(&interrupt) {}

  std::int64_t now_ns() const { return real_ ? monotonic_now_ns() : simulated_ns_; }

  // False if interrupted before.
  bool wait_until(std::int64_t deadline_ns) {
    if (real_) return interrupt_->wait_until(deadline_ns);
    simulated_ns_ = std::max(simulated_ns_, deadline_ns);
    return !interrupt_->requested();
  }

 private:
  const bool real_;
  const Interrupt* interrupt_;
  std::int64_t simulated_ns_ = 0;
};

// When each frame is due: a fixed time and a whole number of periods, so that no error adds up.
class Schedule {
 public:
  explicit Schedule(double fps) : fps_(fps) {}

  bool started() const { return started_; }
  void start(std::uint64_t frame, std::int64_t due_ns) {
    started_ = true;
    first_ = frame;
    epoch_ns_ = due_ns;
  }
  std::int64_t due_ns(std::uint64_t frame) const {
    return epoch_ns_ + std::llround(static_cast<double>(frame - first_) * 1e9 / fps_);
  }
  // The newest frame that is due at `now_ns`, at least `frame`.
  std::uint64_t newest_due(std::uint64_t frame, std::int64_t now_ns) const {
    const double periods = static_cast<double>(now_ns - epoch_ns_) * fps_ / 1e9;
    if (periods < 1) return frame;
    std::uint64_t newest = first_ + static_cast<std::uint64_t>(periods);
    if (due_ns(newest) > now_ns) --newest;
    return std::max(frame, newest);
  }

 private:
  const double fps_;
  bool started_ = false;
  std::uint64_t first_ = 0;
  std::int64_t epoch_ns_ = 0;
};

class FileCamera : public Camera {
 public:
  FileCamera(const FileCameraOptions& options, FaultScript faults,
             std::unique_ptr<Interrupt> interrupt, std::unique_ptr<FrameSource> source,
             FramePool& pool)
      : options_(options),
        faults_(std::move(faults)),
        interrupt_(std::move(interrupt)),
        source_(std::move(source)),
        pool_(&pool),
        clock_(real_time(), *interrupt_),
        schedule_(options.fps),
        sequence_(static_cast<std::uint64_t>(options.start)) {
    faults_.discard_before(sequence_);
  }

  CameraEvent next() override {
    while (!interrupt_->requested() && !ended_) {
      if (!break_) skip_unused();
      if (std::optional<CameraError> away = play_break()) return *std::move(away);
      if (!wait_for_turn()) break;
      if (std::optional<CameraEvent> event = deliver()) return *std::move(event);
    }
    if (interrupt_->requested()) return Interrupted{};
    return EndOfStream{};
  }

  void interrupt() override { interrupt_->request(); }

  std::string describe() const override {
    std::array<char, 64> pace{};
    std::snprintf(pace.data(), pace.size(), "at %g fps in real time", options_.fps);
    return source_->describe() +
           (real_time() ? std::string(", ") + pace.data() : std::string(", as fast as possible"));
  }

  std::uint64_t dropped() const override { return dropped_; }

 private:
  // A stall or an unplugging under way.
  struct Break {
    Fault fault;
    std::int64_t end_ns = 0;
    bool announced = false;  ///< the unplugging has been reported
  };

  bool real_time() const { return options_.fps > 0; }

  std::int64_t stall_timeout_ns() const {
    const double fps = real_time() ? options_.fps : kSimulatedFps;
    return std::max(kSecond_ns, static_cast<std::int64_t>(5e9 / fps));
  }

  // While away, one call waits this long.
  std::int64_t patience_ns() const {
    if (break_->fault.kind == FaultKind::kStall) return stall_timeout_ns();
    return real_time() ? kRetry_ns : static_cast<std::int64_t>(1e9 / kSimulatedFps);
  }

  // Plays the stalls and unpluggings due before the next frame: an error to report, or none when
  // they are over (or interrupted).
  std::optional<CameraError> play_break() {
    while (begin_break()) {
      if (break_->fault.kind == FaultKind::kUnplug && !break_->announced) {
        break_->announced = true;
        return away(CameraFault::kUnplugged, "was unplugged");
      }
      const std::int64_t until_ns = std::min(clock_.now_ns() + patience_ns(), break_->end_ns);
      if (!clock_.wait_until(until_ns)) return std::nullopt;
      if (until_ns < break_->end_ns)
        return break_->fault.kind == FaultKind::kStall
                   ? away(CameraFault::kStalled, "gave no frame for the stall time-out")
                   : away(CameraFault::kNoDevice, "is still unplugged");
      end_break();
    }
    return std::nullopt;
  }

  bool begin_break() {
    if (break_) return true;
    const Fault* fault = faults_.take_break(sequence_);
    if (fault == nullptr) return false;
    break_ = Break{*fault, clock_.now_ns() + fault->duration_ns, false};
    return true;
  }

  void end_break() {
    if (real_time()) schedule_.start(sequence_, break_->end_ns);
    if (!real_time()) away_ns_ = saturating_add(away_ns_, break_->fault.duration_ns);
    break_.reset();
  }

  CameraError away(CameraFault fault, const std::string& what) const {
    return {fault,
            "the camera of " + options_.path + " " + what + ", as scripted at frame " +
                std::to_string(break_->fault.frame),
            fault == CameraFault::kStalled ? ETIMEDOUT : ENODEV, true,
            source_->camera_sequence(sequence_)};
  }

  void skip_to(std::uint64_t frame) {
    dropped_ += frame - sequence_;
    sequence_ = frame;
  }

  // Past the frames whose turn went by unused, and past those scripted to be dropped.
  void skip_unused() {
    if (real_time()) skip_late();
    skip_to(faults_.after_drops(sequence_));
  }

  void skip_late() {
    const std::int64_t now_ns = clock_.now_ns();
    if (!schedule_.started()) schedule_.start(sequence_, now_ns);
    std::uint64_t newest = schedule_.newest_due(sequence_, now_ns);
    if (!options_.loop && source_->length() > 0)
      newest = std::max(sequence_, std::min(newest, source_->length()));
    skip_to(newest);
  }

  // False if interrupted before.
  bool wait_for_turn() { return !real_time() || clock_.wait_until(schedule_.due_ns(sequence_)); }

  // The frame whose turn it is, or what became of it; none if it was dropped for want of a buffer.
  std::optional<CameraEvent> deliver() {
    const std::int64_t now_ns = clock_.now_ns();
    const FrameSource::Prepared prepared = source_->prepare(sequence_, faults_.corrupts(sequence_));
    if (const auto* error = std::get_if<CameraError>(&prepared)) return lose_frame(*error);
    if (std::holds_alternative<Interrupted>(prepared)) return std::nullopt;
    if (std::holds_alternative<EndOfStream>(prepared)) {
      ended_ = true;
      return std::nullopt;
    }
    const ImageSize size = std::get<ImageSize>(prepared);
    FrameBuffer buffer = real_time() ? pool_->acquire() : pool_->acquire(interrupt_->token());
    if (buffer == nullptr) {
      if (real_time()) skip_to(sequence_ + 1);
      return std::nullopt;
    }
    if (std::optional<CameraError> error = source_->decode({buffer.get(), pool_->bytes_each()}))
      return lose_frame(*error);
    bad_frames_ = 0;
    return make_frame(std::move(buffer), size, now_ns);
  }

  CameraEvent make_frame(FrameBuffer buffer, const ImageSize& size, std::int64_t now_ns) {
    Frame frame;
    frame.buffer = std::move(buffer);
    frame.width_px = size.width_px;
    frame.height_px = size.height_px;
    frame.stride_bytes = size.width_px;
    frame.time_ns = time_of(sequence_, now_ns);
    frame.sequence = source_->camera_sequence(sequence_);
    ++sequence_;
    return frame;
  }

  std::optional<std::int64_t> time_of(std::uint64_t sequence, std::int64_t now_ns) const {
    std::optional<std::int64_t> time_ns = now_ns;
    if (!real_time()) time_ns = source_->time_ns(sequence);
    if (!time_ns) return std::nullopt;
    return saturating_add(saturating_add(*time_ns, away_ns_), faults_.jump_ns(sequence));
  }

  // Without a clock, a folder in which a whole lap is unreadable would be gone over for ever.
  CameraEvent lose_frame(const CameraError& error) {
    ++sequence_;
    ++bad_frames_;
    if (!real_time() && source_->length() > 0 && bad_frames_ >= source_->length()) ended_ = true;
    return error;
  }

  const FileCameraOptions options_;
  FaultScript faults_;
  const std::unique_ptr<Interrupt> interrupt_;
  const std::unique_ptr<FrameSource> source_;
  FramePool* const pool_;
  CaptureClock clock_;
  Schedule schedule_;
  std::uint64_t sequence_;  ///< number of the next frame, counted over all laps
  std::optional<Break> break_;
  std::int64_t away_ns_ = 0;      ///< simulated time spent in stalls and unpluggings
  std::uint64_t bad_frames_ = 0;  ///< lost in a row
  bool ended_ = false;
  std::atomic<std::uint64_t> dropped_ = 0;
};

bool in_range(double fps) { return fps >= 0 && fps <= kMaxFps; }

Status check(const FileCameraOptions& options) {
  std::string problems;
  if (options.path.empty()) problems += "; no path is given";
  if (!in_range(options.fps)) problems += "; fps must be 0 to 1000";
  if (!in_range(options.nominal_fps)) problems += "; nominal_fps must be 0 to 1000";
  if (options.start < 0) problems += "; start must be 0 or more";
  if (problems.empty()) return Nothing{};
  return Error{"cannot open the file camera \"" + options.path + "\": " + problems.substr(2),
               EINVAL};
}

enum class FileKind : std::uint8_t { kImage, kRecording, kOther };

FileKind file_kind(const std::string& path) {
  std::FILE* file = std::fopen(path.c_str(), "rbe");
  if (file == nullptr) return FileKind::kOther;
  std::array<std::uint8_t, 16> bytes{};
  const std::size_t length = std::fread(bytes.data(), 1, bytes.size(), file);
  std::fclose(file);
  const std::span<const std::uint8_t> start(bytes.data(), length);
  if (is_recording(start)) return FileKind::kRecording;
  return image_format(start) ? FileKind::kImage : FileKind::kOther;
}

// One image is a folder of one; what is neither image nor recording is left to the video decoder.
Result<std::unique_ptr<FrameSource>> open_file(const SourceOptions& source,
                                               const std::string& video_decoder,
                                               const Interrupt& interrupt) {
  switch (file_kind(source.path)) {
    case FileKind::kImage:
      return open_folder_source(source);
    case FileKind::kRecording:
      return open_recording_source(source, interrupt);
    case FileKind::kOther:
      break;
  }
  return open_video_source(source, video_decoder, interrupt);
}

Result<std::unique_ptr<FrameSource>> open_source(const FileCameraOptions& options,
                                                 const FramePool& pool,
                                                 const Interrupt& interrupt) {
  struct stat status {};
  if (::stat(options.path.c_str(), &status) != 0)
    return errno_error("cannot open " + options.path, errno);
  // No device is opened to see what it is: that alone can have consequences.
  if (S_ISCHR(status.st_mode))
    return Error{"cannot open " + options.path +
                     ": it is a device, no recording; for a camera set camera.source = \"v4l2\"",
                 ENOTSUP};
  const SourceOptions source{options.path, options.loop, options.nominal_fps, pool.bytes_each()};
  if (S_ISDIR(status.st_mode)) return open_folder_source(source);
  if (!S_ISREG(status.st_mode))
    return Error{"cannot open " + options.path + ": it is neither a folder nor a file", ENOTSUP};
  return open_file(source, options.video_decoder, interrupt);
}

}  // namespace

Result<std::unique_ptr<Camera>> open_file_camera(const FileCameraOptions& options,
                                                 FramePool& pool) {
  if (const Status status = check(options); !status.ok()) return status.error();
  Result<FaultScript> faults = FaultScript::parse(options.faults);
  if (!faults.ok()) return faults.error();
  auto interrupt = std::make_unique<Interrupt>();
  Result<std::unique_ptr<FrameSource>> source = open_source(options, pool, *interrupt);
  if (!source.ok()) return source.error();
  const std::uint64_t length = (*source)->length();
  if (length > 0 && static_cast<std::uint64_t>(options.start) >= length)
    return Error{"cannot start " + options.path + " at frame " + std::to_string(options.start) +
                     ": it has " + std::to_string(length) + " frames",
                 EINVAL};
  return std::unique_ptr<Camera>(std::make_unique<FileCamera>(
      options, std::move(faults).value(), std::move(interrupt), std::move(source).value(), pool));
}

}  // namespace loopd
