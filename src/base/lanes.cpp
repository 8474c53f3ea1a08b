#include "base/lanes.h"

#include <utility>

namespace loopd {
namespace {

std::exception_ptr failure_of(const std::function<void()>& job) {
  try {
    job();
  } catch (...) {
    return std::current_exception();
  }
  return nullptr;
}

}  // namespace

Result<std::unique_ptr<TwoLanes>> TwoLanes::start(const ThreadOptions& lines_lane) {
  std::unique_ptr<TwoLanes> lanes(new TwoLanes);
  // lane() catches whatever a job throws, so nothing is left to report at the thread's top.
  Result<NamedThread> thread = NamedThread::start(
      lines_lane, [self = lanes.get()] { self->lane(); }, nullptr);
  if (!thread) return thread.error();
  lanes->thread_ = std::move(thread).value();
  return lanes;
}

TwoLanes::~TwoLanes() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  posted_.notify_one();
}

void TwoLanes::run(const std::function<void()>& points, const std::function<void()>& lines) {
  {
    const std::lock_guard lock(mutex_);
    job_ = &lines;
  }
  posted_.notify_one();
  const std::exception_ptr points_failure = failure_of(points);
  const std::exception_ptr lines_failure = wait_for_lines();
  if (points_failure) std::rethrow_exception(points_failure);
  if (lines_failure) std::rethrow_exception(lines_failure);
}

std::exception_ptr TwoLanes::wait_for_lines() {
  std::unique_lock lock(mutex_);
  finished_.wait(lock, [this] { return job_ == nullptr; });
  return std::exchange(failure_, nullptr);
}

void TwoLanes::lane() {
  std::unique_lock lock(mutex_);
  while (true) {
    posted_.wait(lock, [this] { return ending_ || job_ != nullptr; });
    if (ending_) return;
    const std::function<void()>* const job = job_;
    lock.unlock();
    std::exception_ptr failure = failure_of(*job);
    lock.lock();
    failure_ = std::move(failure);
    job_ = nullptr;
    finished_.notify_one();
  }
}

}  // namespace loopd
