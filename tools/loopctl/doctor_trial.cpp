#include "loopctl/doctor_trial.h"

#include <cmath>
#include <new>

#include "app/camera_factory.h"
#include "base/frame_pool.h"

namespace loopd::loopctl {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::uint64_t kLiveFrames = 45;    // 1.5 s at the usual rate
constexpr std::uint64_t kWarmUpFrames = 15;  // exposure settles, and the rate with it
constexpr std::uint64_t kRecordedFrames = 5;
constexpr std::chrono::seconds kTime{5};
constexpr std::size_t kBuffers = 3;

/// The arrival of frames after the camera has settled.
class Arrivals {
 public:
  void add(std::uint64_t frame) {
    if (frame == kWarmUpFrames) first_ = Clock::now();
    if (frame > kWarmUpFrames) {
      last_ = Clock::now();
      ++periods_;
    }
  }
  double rate_hz() const {
    const double seconds = std::chrono::duration<double>(last_ - first_).count();
    return periods_ < 5 || seconds <= 0 ? 0 : static_cast<double>(periods_) / seconds;
  }

 private:
  Clock::time_point first_, last_;
  std::uint64_t periods_ = 0;
};

void take(Trial& trial, const CameraError& error) {
  if (error.lost) {
    trial.lost = error;
  } else {
    ++trial.corrupt;
  }
}

void take(Trial& trial, const CameraNotice& notice) {
  switch (notice.kind) {
    case CameraNotice::Kind::kSettings:
      trial.settings.push_back(notice.message);
      break;
    case CameraNotice::Kind::kTimeStamps:
      trial.time_stamps.push_back(notice.message);
      break;
    default:
      trial.opened = notice.message;
  }
}

void take(Trial& trial, const Frame& frame) {
  ++trial.frames;
  trial.width_px = frame.width_px;
  trial.height_px = frame.height_px;
  if (frame.width_px > 0 && frame.height_px > 0) trial.look = look_at(frame.view());
}

Findings judge_look(const LumaLook& look) {
  constexpr double kBlack = 10, kWhite = 245, kFlat = 4;
  if (look.mean < kBlack)
    return {Finding::warning("image",
                             "the images are black (mean " + decimal(look.mean, 0) + " of 255)",
                             "take the lens cap off, give more light, or correct the exposure in "
                             "camera.controls")};
  if (look.mean > kWhite)
    return {Finding::warning("image",
                             "the images are white (mean " + decimal(look.mean, 0) + " of 255)",
                             "shorten the exposure in camera.controls")};
  if (look.deviation < kFlat)
    return {Finding::warning("image", "the images show nothing, all pixels are alike",
                             "take the lens cap off, focus, or point the camera elsewhere")};
  return {Finding::ok("image", "brightness " + decimal(look.mean, 0) + " of 255, contrast " +
                                   decimal(look.deviation, 0))};
}

Findings judge_rate(const Trial& trial, const CameraConfig& config) {
  constexpr double kEnough = 0.85;
  if (trial.rate_hz <= 0) return {};
  const std::string rate = decimal(trial.rate_hz, 1) + " frames/s come";
  if (config.fps <= 0 || trial.rate_hz >= kEnough * config.fps) return {Finding::ok("trial", rate)};
  return {Finding::warning(
      "trial", rate + ", not " + decimal(config.fps, 1),
      "give more light or a shorter exposure (automatic exposure slows cameras down in the dark), "
      "a smaller size, or a USB port of its own")};
}

Findings judge_faults(const Trial& trial) {
  Findings findings;
  for (const std::string& text : trial.settings)
    findings.push_back(Finding::warning("trial", text, "loopd works without it; see camera.*"));
  for (const std::string& text : trial.time_stamps)
    findings.push_back(Finding::warning(
        "trial", text, "tell back-ends that times of frames are a little late and uneven"));
  if (trial.corrupt > 0)
    findings.push_back(Finding::warning("trial",
                                        std::to_string(trial.corrupt) + " of " +
                                            std::to_string(trial.frames + trial.corrupt) +
                                            " frames were damaged",
                                        "try another cable or port, without a hub"));
  return findings;
}

}  // namespace

LumaLook look_at(const LumaView& view) {
  constexpr int kStep = 8;
  double sum = 0, squares = 0, count = 0;
  for (int y = 0; y < view.height_px; y += kStep) {
    const std::uint8_t* row = view.data + static_cast<std::ptrdiff_t>(y) * view.stride_bytes;
    for (int x = 0; x < view.width_px; x += kStep) {
      const double value = row[x];
      sum += value;
      squares += value * value;
      ++count;
    }
  }
  const double mean = sum / count;
  return {mean, std::sqrt(std::max(0.0, squares / count - mean * mean))};
}

Trial try_out(Camera& camera, std::uint64_t frames, std::chrono::milliseconds time) {
  Trial trial;
  Arrivals arrivals;
  const auto deadline = Clock::now() + time;
  while (trial.frames < frames && Clock::now() < deadline) {
    const CameraEvent event = camera.next();
    if (const auto* frame = std::get_if<Frame>(&event)) {
      arrivals.add(trial.frames);
      take(trial, *frame);
    } else if (const auto* error = std::get_if<CameraError>(&event)) {
      take(trial, *error);
    } else if (const auto* notice = std::get_if<CameraNotice>(&event)) {
      take(trial, *notice);
    } else {
      break;
    }
  }
  trial.rate_hz = arrivals.rate_hz();
  trial.restamped = camera.restamped();
  return trial;
}

Result<Trial> try_camera(const CameraConfig& config) {
  try {
    FramePool pool(kBuffers, static_cast<std::size_t>(config.max_pixels));
    auto camera = open_camera(config, pool);
    if (!camera) return camera.error();
    return try_out(**camera, config.live() ? kLiveFrames : kRecordedFrames, kTime);
  } catch (const std::bad_alloc&) {
    return Error{"no memory for frames of camera.max_pixels = " + std::to_string(config.max_pixels),
                 ENOMEM};
  }
}

Findings judge_trial(const Trial& trial, const CameraConfig& config) {
  if (trial.frames == 0) {
    if (trial.lost) return {Finding::problem("trial", trial.lost->message, "")};
    return {Finding::problem("trial", "no image came",
                             trial.corrupt > 0 ? "all that came were damaged: try another cable"
                                               : "look at the camera, and at dmesg")};
  }
  const std::string opened = trial.opened.empty() ? "" : ": " + trial.opened;
  Findings findings = {Finding::ok("trial", std::to_string(trial.frames) + " images of " +
                                                std::to_string(trial.width_px) + "x" +
                                                std::to_string(trial.height_px) + opened)};
  if (config.live()) append(findings, judge_rate(trial, config));
  append(findings, judge_faults(trial));
  if (trial.look) append(findings, judge_look(*trial.look));
  return findings;
}

}  // namespace loopd::loopctl
