#include "app/pipeline.h"

#include <sched.h>

#include <cassert>
#include <exception>
#include <utility>

#include "app/camera_factory.h"
#include "app/memory_plan.h"

namespace loopd {
namespace {

/// The CPUs that this thread may use.
std::vector<int> allowed_cpus() {
  cpu_set_t set;
  CPU_ZERO(&set);
  std::vector<int> cpus;
  if (sched_getaffinity(0, sizeof(set), &set) != 0) return cpus;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu)
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &set)) cpus.push_back(cpu);
  return cpus;
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
  auto camera = open_camera(config.camera, *pool);
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
      all_cpus_(allowed_cpus()),
      pool_(std::move(parts.pool)),
      camera_(std::move(parts.camera)),
      lanes_(std::move(parts.lanes)),
      wakeup_(std::move(parts.wakeup)),
      reports_(static_cast<std::size_t>(config.events.report_queue), config.camera.lock_step()),
      detector_(detector_config(config), lanes_.get()),
      map_bytes_(detector_.capacity_bytes()),
      capture_(mailbox_, tap_, notices_, wakeup_, capture_counters_, config.camera.lock_step()),
      detect_(detector_, mailbox_, reports_, notices_, wakeup_, capture_counters_,
              !config.camera.lock_step()) {}

Pipeline::~Pipeline() { stop(); }

Status Pipeline::start() {
  const Status detect = start_thread(
      detect_thread_,
      thread_options("detect", threads_.detect_cpus, threads_.detect_priority, threads_.required),
      [this] { detect_.run(); });
  if (!detect) return detect;
  return start_capture();
}

Status Pipeline::start_capture() {
  // Its CPUs are always named: a later one is started by a thread that has others by then.
  const std::vector<int>& cpus = threads_.capture_cpus.empty() ? all_cpus_ : threads_.capture_cpus;
  return start_thread(capture_thread_,
                      thread_options("capture", cpus, threads_.capture_priority, threads_.required),
                      [this] { capture_.run(*camera_); });
}

Status Pipeline::replace_camera(const CameraConfig& config) {
  assert(config.live() && "a recording has an end, after which nothing can follow");
  const bool running = capture_thread_.running();
  camera_->interrupt();
  capture_thread_.join();
  dropped_before_ += camera_->dropped();
  restamped_before_ += camera_->restamped();
  camera_.reset();                // before the next is made: a device is busy as long as it is open
  capture_counters_.away = true;  // no frame is owed until the new one gives its first
  auto camera = open_camera(config, *pool_);
  assert(camera.ok() && "a live camera need not be there");
  camera_ = std::move(camera).value();
  if (!running) return Nothing{};
  return start_capture();
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
  const DetectTotals done = totals();
  if (detect_.holding()) return false;
  return delivered > mailbox_.overwritten() + done.frames + done.skipped;
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
