#include "app/pipeline.h"

#include <exception>
#include <utility>

#include "capture/file_camera.h"

namespace loopd {
namespace {

FileCameraOptions file_camera_options(const CameraConfig& camera) {
  FileCameraOptions options;
  options.path = camera.path;
  options.fps = camera.fps;
  options.loop = camera.loop;
  options.start = camera.start;
  options.nominal_fps = camera.nominal_fps;
  options.faults = camera.faults;
  return options;
}

ThreadOptions thread_options(const char* name, const std::vector<int>& cpus, int priority,
                             bool required) {
  return {.name = name, .cpus = cpus, .priority = priority, .required = required};
}

std::string text_of(const std::exception_ptr& exception) {
  try {
    std::rethrow_exception(exception);
  } catch (const std::exception& error) {
    return error.what();
  } catch (...) {
    return "an exception of unknown type";
  }
}

}  // namespace

/// What can fail to be made, made before the Pipeline itself.
struct Pipeline::Parts {
  std::unique_ptr<FramePool> pool;
  std::unique_ptr<Camera> camera;
  std::unique_ptr<TwoLanes> lanes;
  Wakeup wakeup;
};

Result<std::unique_ptr<Pipeline>> Pipeline::open(const DaemonConfig& config) {
  auto pool = std::make_unique<FramePool>(static_cast<std::size_t>(config.camera.buffers),
                                          static_cast<std::size_t>(config.camera.max_pixels));
  auto camera = open_file_camera(file_camera_options(config.camera), *pool);
  if (!camera) return camera.error();
  auto wakeup = Wakeup::make();
  if (!wakeup) return wakeup.error();
  std::unique_ptr<TwoLanes> lanes;
  if (config.threads.lanes == 2) {
    const ThreadsConfig& threads = config.threads;
    auto started = TwoLanes::start(
        thread_options("lines", threads.lines_cpus, threads.lines_priority, threads.required));
    if (!started) return started.error();
    lanes = std::move(started).value();
  }
  return std::unique_ptr<Pipeline>(new Pipeline(
      config,
      {std::move(pool), std::move(camera).value(), std::move(lanes), std::move(wakeup).value()}));
}

Pipeline::Pipeline(const DaemonConfig& config, Parts parts)
    : threads_(config.threads),
      pool_(std::move(parts.pool)),
      camera_(std::move(parts.camera)),
      lanes_(std::move(parts.lanes)),
      wakeup_(std::move(parts.wakeup)),
      reports_(static_cast<std::size_t>(config.events.report_queue), config.camera.lock_step()),
      detector_(config.detector, lanes_.get()),
      capture_(*camera_, mailbox_, notices_, wakeup_, capture_counters_, config.camera.lock_step()),
      detect_(detector_, mailbox_, reports_, notices_, wakeup_, capture_counters_,
              !config.camera.lock_step()) {}

Pipeline::~Pipeline() { stop(); }

Status Pipeline::start() {
  const Status detect = start_thread(
      detect_thread_,
      thread_options("detect", threads_.detect_cpus, threads_.detect_priority, threads_.required),
      [this] { detect_.run(); });
  if (!detect) return detect;
  return start_thread(capture_thread_,
                      thread_options("capture", threads_.capture_cpus, threads_.capture_priority,
                                     threads_.required),
                      [this] { capture_.run(); });
}

Status Pipeline::start_thread(NamedThread& thread, const ThreadOptions& options,
                              std::function<void()> body) {
  Result<NamedThread> started = NamedThread::start(options, std::move(body), on_exception());
  if (!started) return started.error();
  thread = std::move(started).value();
  return Nothing{};
}

void Pipeline::stop() {
  detect_.stop();  // so that a frame still in the mailbox is not begun
  camera_->interrupt();
  mailbox_.close();
  capture_thread_.join();
  reports_.close();
  detect_thread_.join();
}

NamedThread::OnException Pipeline::on_exception() {
  return [this](const std::string& name, const std::exception_ptr& exception) {
    {
      const std::lock_guard lock(failure_mutex_);
      failure_ = "thread '" + name + "' died: " + text_of(exception);
    }
    mailbox_.close();
    wakeup_.wake();
  };
}

bool Pipeline::work_pending() const {
  // Read in this order, what is still pending may be missed for a moment but never made up.
  const std::uint64_t delivered = capture_counters_.frames;
  return delivered > mailbox_.overwritten() + totals().frames;
}

std::optional<std::string> Pipeline::failure() const {
  const std::lock_guard lock(failure_mutex_);
  return failure_;
}

std::vector<Error> Pipeline::thread_shortfalls() const {
  std::vector<Error> all;
  const auto append = [&all](const std::vector<Error>& some) {
    all.insert(all.end(), some.begin(), some.end());
  };
  append(capture_thread_.shortfalls());
  append(detect_thread_.shortfalls());
  if (lanes_) append(lanes_->shortfalls());
  return all;
}

}  // namespace loopd
