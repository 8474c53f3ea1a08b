#include "capture/live_camera.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bitset>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <deque>
#include <optional>
#include <utility>

#include "capture/frame_ledger.h"
#include "capture/interrupt.h"
#include "capture/pixel_luma.h"

namespace loopd {
namespace {

constexpr std::int64_t kMs_ns = 1'000'000;
constexpr std::int64_t kSecond_ns = 1'000 * kMs_ns;

constexpr std::int64_t kFirstRetry_ns = 10 * kMs_ns;
constexpr std::int64_t kLastRetry_ns = 500 * kMs_ns;
// Plugging a camera in makes a handful of changes in /dev; this far apart they are worth a try
// each.
constexpr std::int64_t kHotplugSpacing_ns = 10 * kMs_ns;

constexpr double kUsualFps = 30;  // where the driver does not know its own
constexpr double kLeastFps = 0.1;
constexpr double kMostFps = 2000;
constexpr std::int64_t kLongestFirstFrame_ns = 4 * kSecond_ns;
// So many damaged frames in a row, and for as long as the time-out, are no accident.
constexpr std::uint64_t kFewBadFrames = 5;

double believable_fps(double fps) {
  return fps > 0 ? std::clamp(fps, kLeastFps, kMostFps) : kUsualFps;
}

std::string fps_text(double fps) {
  if (!(fps > 0)) return "an unknown rate";
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g fps", fps);
  return text.data();
}

std::string camera_text(const DeviceInfo& info) {
  return info.name + " (" + info.node + ", " + info.id + ")";
}

std::string stream_text(const DeviceInfo& info) {
  return std::to_string(info.width_px) + "x" + std::to_string(info.height_px) + " " +
         std::string(pixel_format_name(info.format)) + " at " + fps_text(info.fps);
}

// Times and back-offs of getting a lost camera back.
class RetrySchedule {
 public:
  // At `now_ns` the camera was lost, or an attempt to open it failed. True if that is to be told:
  // the first time, and then twice a second.
  bool failed(std::int64_t now_ns, bool always_tell) {
    last_attempt_ns_ = now_ns;
    const bool tell = always_tell || !next_tell_ns_ || now_ns >= *next_tell_ns_;
    if (tell) next_tell_ns_ = now_ns + kLastRetry_ns;
    retry_ns_ = std::min(now_ns + backoff_ns_, *next_tell_ns_);
    backoff_ns_ = std::min(2 * backoff_ns_, kLastRetry_ns);
    return tell;
  }
  // A good frame came.
  void succeeded() {
    backoff_ns_ = kFirstRetry_ns;
    next_tell_ns_.reset();
  }

  std::int64_t retry_ns() const { return retry_ns_; }
  std::int64_t earliest_ns() const {
    return std::min(retry_ns_, last_attempt_ns_ + kHotplugSpacing_ns);
  }

 private:
  std::int64_t backoff_ns_ = kFirstRetry_ns;
  std::int64_t last_attempt_ns_ = 0;
  std::int64_t retry_ns_ = 0;
  std::optional<std::int64_t> next_tell_ns_;
};

class LiveCamera : public Camera {
 public:
  LiveCamera(std::unique_ptr<CaptureDriver> driver, FramePool& pool, LiveClock* clock)
      : driver_(std::move(driver)),
        pool_(&pool),
        clock_(clock != nullptr ? clock : &real_clock_),
        converter_(pool.bytes_each()) {}

  CameraEvent next() override {
    while (!interrupt_.requested()) {
      if (!notices_.empty()) {
        CameraEvent notice = std::move(notices_.front());
        notices_.pop_front();
        return notice;
      }
      if (std::optional<CameraEvent> event = device_ ? stream() : reopen())
        return *std::move(event);
    }
    return Interrupted{};
  }

  void interrupt() override { interrupt_.request(); }

  std::string describe() const override {
    if (!device_) return driver_->describe() + ", not open";
    return driver_->describe() + ": " + camera_text(device_->info()) + ", " +
           stream_text(device_->info());
  }

  std::uint64_t dropped() const override { return dropped_; }
  std::uint64_t restamped() const override { return restamped_; }

 private:
  // One wait and one attempt; none if nothing is to be told of it.
  std::optional<CameraEvent> reopen() {
    if (!wait_for_retry()) return std::nullopt;
    driver_->acknowledge();  // before, so that what changes from here on wakes the next wait
    const std::int64_t start_ns = clock_->now_ns();
    CaptureDriver::Opened opened = driver_->open();
    if (auto* error = std::get_if<CameraError>(&opened)) {
      if (!retry_.failed(clock_->now_ns(), false)) return std::nullopt;
      return lost(std::move(*error));
    }
    begin(std::get<std::unique_ptr<CaptureDevice>>(std::move(opened)), start_ns);
    return std::nullopt;
  }

  // False if interrupted before.
  bool wait_for_retry() {
    if (clock_->wait(interrupt_, -1, retry_.earliest_ns()) == Interrupt::Ready::kInterrupted)
      return false;
    return clock_->wait(interrupt_, driver_->hotplug_fd(), retry_.retry_ns()) !=
           Interrupt::Ready::kInterrupted;
  }

  void begin(std::unique_ptr<CaptureDevice> device, std::int64_t start_ns) {
    device_ = std::move(device);
    const DeviceInfo& info = device_->info();
    const double fps = believable_fps(info.fps);
    timeout_ns_ = std::max(kSecond_ns, static_cast<std::int64_t>(5e9 / fps));
    any_frame_ = false;
    last_frame_ns_ = last_good_ns_ = clock_->now_ns();
    bad_ = 0;
    most_bad_ = kFewBadFrames +
                static_cast<std::uint64_t>(4 * fps * static_cast<double>(timeout_ns_) / kSecond_ns);
    sequences_.begin(last_frame_ns_);
    stamps_.begin(start_ns);
    stamp_faults_told_.reset();
    tell_opened(info);
  }

  void tell_opened(const DeviceInfo& info) {
    if (!last_id_.empty() && last_id_ != info.id)
      notices_.push_back(
          {CameraNotice::Kind::kOtherCamera,
           "another camera is there now: it was " + last_camera_ + ", it is " + camera_text(info)});
    notices_.push_back({CameraNotice::Kind::kOpened, "opened " + camera_text(info) + ": " +
                                                         stream_text(info) + ", time stamps by " +
                                                         info.clock + " clock"});
    for (const std::string& warning : info.warnings)
      notices_.push_back({CameraNotice::Kind::kSettings, warning});
    last_id_ = info.id;
    last_camera_ = camera_text(info);
  }

  // One wait for a frame; none if there is nothing to deliver or to tell.
  std::optional<CameraEvent> stream() {
    CaptureDevice::Grab grab = device_->grab(interrupt_, last_frame_ns_ + patience_ns());
    if (std::holds_alternative<Interrupted>(grab)) return std::nullopt;
    if (std::holds_alternative<TimedOut>(grab)) return stalled("gave no frame");
    if (auto* error = std::get_if<CameraError>(&grab)) {
      if (error->lost) return lose(std::move(*error));
      error->sequence = sequences_.next();
      return bad_frame(std::move(*error));
    }
    std::optional<CameraEvent> event = deliver(std::get<RawFrame>(grab));
    if (device_) device_->release();
    return event;
  }

  // How long the next frame may take.
  std::int64_t patience_ns() const {
    return any_frame_ ? timeout_ns_ : std::max(timeout_ns_, first_frame_ns_);
  }

  // The first frame of an opening took so long; the next opening's may take twice that.
  void learn_start(std::int64_t took_ns) {
    first_frame_ns_ = took_ns > timeout_ns_ ? std::min(2 * took_ns, kLongestFirstFrame_ns) : 0;
  }

  std::optional<CameraEvent> deliver(const RawFrame& raw) {
    const std::int64_t now_ns = clock_->now_ns();
    const SequenceLedger::Entry entry = sequences_.enter(raw.sequence, raw.passed_over, now_ns);
    dropped_ += entry.lost + raw.passed_over;
    if (!any_frame_) learn_start(now_ns - last_frame_ns_);
    any_frame_ = true;
    last_frame_ns_ = now_ns;
    if (raw.damaged)
      return bad_frame(frame_error(CameraFault::kCorruptFrame, entry.sequence,
                                   "the driver flags it as damaged"));
    FrameBuffer buffer = pool_->acquire();
    if (buffer == nullptr) {
      ++dropped_;
      return std::nullopt;
    }
    if (const auto problem = converter_.convert(raw, {buffer.get(), pool_->bytes_each()}))
      return bad_frame(frame_error(problem->fault, entry.sequence, problem->message));
    last_good_ns_ = now_ns;
    bad_ = 0;
    retry_.succeeded();
    return make_frame(raw, std::move(buffer), entry.sequence, now_ns);
  }

  Frame make_frame(const RawFrame& raw, FrameBuffer buffer, std::uint64_t sequence,
                   std::int64_t now_ns) {
    const StampJudge::Verdict verdict = stamps_.judge(raw.time_ns, now_ns);
    if (verdict.fault) restamp(verdict);
    Frame frame;
    frame.buffer = std::move(buffer);
    frame.width_px = raw.width_px;
    frame.height_px = raw.height_px;
    frame.stride_bytes = raw.width_px;
    frame.time_ns = verdict.time_ns;
    frame.sequence = sequence;
    return frame;
  }

  void restamp(const StampJudge::Verdict& verdict) {
    ++restamped_;
    const auto kind = static_cast<std::size_t>(*verdict.fault);
    if (stamp_faults_told_.test(kind)) return;
    stamp_faults_told_.set(kind);
    notices_.push_back(
        {CameraNotice::Kind::kTimeStamps, "the time stamps of " + camera_text(device_->info()) +
                                              " cannot be used where they " + stamp_text(verdict) +
                                              ": such a frame gets the time at which it came"});
  }

  static std::string stamp_text(const StampJudge::Verdict& verdict) {
    switch (*verdict.fault) {
      case StampFault::kMissing:
        return "are missing or of an unknown clock";
      case StampFault::kFuture:
        return "lie in the future (by " + std::to_string(verdict.off_ns / kMs_ns) + " ms)";
      case StampFault::kStill:
        return "stand still";
      case StampFault::kBack:
        return "go back";
      case StampFault::kOld:
        break;
    }
    return "are older than the stream";
  }

  CameraError frame_error(CameraFault fault, std::uint64_t sequence,
                          const std::string& cause) const {
    return {fault,
            "frame " + std::to_string(sequence) + " of " + camera_text(device_->info()) +
                " is of no use: " + cause,
            fault == CameraFault::kTooLarge ? EFBIG : EBADMSG, false, sequence};
  }

  // Passes the error of one frame on, or gives the device up if there is nothing else.
  CameraEvent bad_frame(CameraError error) {
    if (error.fault == CameraFault::kTooLarge) return lose(std::move(error));  // so are all others
    ++bad_;
    const bool for_long =
        bad_ >= kFewBadFrames && clock_->now_ns() - last_good_ns_ >= patience_ns();
    if (!for_long && bad_ < most_bad_) return error;
    return stalled("gave " + std::to_string(bad_) + " unusable frames in a row, and no other");
  }

  CameraEvent stalled(const std::string& what) {
    if (!any_frame_) first_frame_ns_ = std::min(2 * patience_ns(), kLongestFirstFrame_ns);
    const std::int64_t waited_ms = (clock_->now_ns() - last_good_ns_) / kMs_ns;
    return lose({CameraFault::kStalled,
                 camera_text(device_->info()) + " " + what + " for " + std::to_string(waited_ms) +
                     " ms; it is opened again; check its cable and power",
                 ETIMEDOUT, true, 0});
  }

  // Closes the device before the retry is timed: closing one that went away may take a while.
  CameraEvent lose(CameraError error) {
    device_.reset();
    retry_.failed(clock_->now_ns(), true);
    return lost(std::move(error));
  }

  CameraError lost(CameraError error) const {
    error.lost = true;
    error.sequence = sequences_.next();
    return error;
  }

  Interrupt interrupt_;
  const std::unique_ptr<CaptureDriver> driver_;
  FramePool* const pool_;
  LiveClock real_clock_;
  LiveClock* const clock_;
  LumaConverter converter_;
  std::unique_ptr<CaptureDevice> device_;  ///< empty while lost
  RetrySchedule retry_;
  std::deque<CameraNotice> notices_;  ///< to be told before anything else
  SequenceLedger sequences_;
  StampJudge stamps_;
  std::bitset<kStampFaults> stamp_faults_told_;  ///< in this opening
  std::string last_id_;                          ///< of the camera opened last
  std::string last_camera_;
  std::int64_t timeout_ns_ = kSecond_ns;
  std::int64_t first_frame_ns_ = 0;  ///< learned: what the first frame after opening may take
  bool any_frame_ = false;           ///< in this opening
  std::int64_t last_frame_ns_ = 0;   ///< when a frame, good or bad, came last; else the opening
  std::int64_t last_good_ns_ = 0;
  std::uint64_t bad_ = 0;  ///< unusable in a row
  std::uint64_t most_bad_ = 0;
  std::atomic<std::uint64_t> dropped_ = 0;
  std::atomic<std::uint64_t> restamped_ = 0;
};

}  // namespace

std::unique_ptr<Camera> make_live_camera(std::unique_ptr<CaptureDriver> driver, FramePool& pool) {
  return std::make_unique<LiveCamera>(std::move(driver), pool, nullptr);
}

std::unique_ptr<Camera> make_live_camera(std::unique_ptr<CaptureDriver> driver, FramePool& pool,
                                         LiveClock& clock) {
  return std::make_unique<LiveCamera>(std::move(driver), pool, &clock);
}

}  // namespace loopd
