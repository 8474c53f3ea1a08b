#include "loopeval/evaluation.h"

#include <algorithm>
#include <filesystem>
#include <utility>
#include <variant>

#include "app/memory_plan.h"
#include "base/clock.h"
#include "capture/file_camera.h"
#include "capture/folder_source.h"

namespace loopd::loopeval {
namespace {

namespace fs = std::filesystem;

Result<std::vector<std::string>> images_of(const std::string& path) {
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) return std::vector<std::string>();
  return list_images(path);
}

}  // namespace

/// What can fail to be made, made before the Evaluation itself.
struct Evaluation::Parts {
  std::vector<std::string> images;
  std::unique_ptr<FramePool> pool;
  std::unique_ptr<Camera> camera;
  std::unique_ptr<TwoLanes> lanes;
};

Result<std::unique_ptr<Camera>> open_recording(const DaemonConfig& config, FramePool& pool) {
  FileCameraOptions options;
  options.path = config.camera.path;
  options.start = config.camera.start;
  options.nominal_fps = config.camera.nominal_fps;
  options.faults = config.camera.faults;
  return open_file_camera(options, pool);
}

Result<std::unique_ptr<Evaluation>> Evaluation::open(const DaemonConfig& config) {
  Parts parts;
  parts.pool = std::make_unique<FramePool>(1, static_cast<std::size_t>(config.camera.max_pixels));
  auto camera = open_recording(config, *parts.pool);
  if (!camera) return camera.error();
  parts.camera = std::move(camera).value();
  auto images = images_of(config.camera.path);
  if (!images) return images.error();
  parts.images = std::move(images).value();
  if (config.threads.lanes == 2) {
    auto lanes = TwoLanes::start({.name = "lines"});
    if (!lanes) return lanes.error();
    parts.lanes = std::move(lanes).value();
  }
  return std::unique_ptr<Evaluation>(new Evaluation(config, std::move(parts)));
}

Evaluation::Evaluation(const DaemonConfig& config, Parts parts)
    : start_(static_cast<std::size_t>(config.camera.start)),
      images_(std::move(parts.images)),
      path_(config.camera.path),
      pool_(std::move(parts.pool)),
      camera_(std::move(parts.camera)),
      lanes_(std::move(parts.lanes)),
      detector_(detector_config(config), lanes_.get()) {
  summary_.source = camera_->describe();
}

std::optional<std::size_t> Evaluation::length() const {
  if (images_.empty()) return std::nullopt;
  return images_.size() - std::min(start_, images_.size());
}

Status Evaluation::run(FramesCsv& csv, Gallery& gallery, Progress& progress) {
  const std::int64_t began_ns = monotonic_now_ns();
  Status status = Nothing{};
  while (status) {
    const CameraEvent event = camera_->next();
    if (const auto* frame = std::get_if<Frame>(&event))
      status = take(*frame, csv, gallery);
    else if (const auto* error = std::get_if<CameraError>(&event))
      status = take(*error, csv, progress);
    else
      break;
    progress.show(summary_.frames, summary_.loops());
  }
  summary_.wall_ns = monotonic_now_ns() - began_ns;
  if (status && away_) return Error{away_->message, away_->code};
  return status;
}

Status Evaluation::take(const Frame& frame, FramesCsv& csv, Gallery& gallery) {
  away_.reset();
  detector_.process(frame, report_);
  detector_.absorb(report_);
  sequences_.push_back(report_.sequence);
  summary_.add(report_);
  gallery.offer(report_, file_name(report_.sequence));
  return csv.write(report_row(report_, file_name(report_.sequence), sequences_));
}

Status Evaluation::take(const CameraError& error, FramesCsv& csv, Progress& progress) {
  if (error.lost) {
    away_ = error;  // of no frame; the camera comes back, or the recording ends here
    return Nothing{};
  }
  progress.note(error.message);
  summary_.add_unreadable();
  return csv.write(unreadable_row(error.sequence, file_name(error.sequence)));
}

std::string Evaluation::file_name(std::uint64_t sequence) const {
  const bool known = sequence < images_.size();
  const std::string& path = known ? images_[static_cast<std::size_t>(sequence)] : path_;
  return fs::path(path).filename().string();
}

}  // namespace loopd::loopeval
