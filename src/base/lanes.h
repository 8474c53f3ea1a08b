#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>

#include "base/result.h"
#include "base/thread.h"
#include "loopd/detector.h"

namespace loopd {

/// Runs the lines half of a stage in a thread of its own and the points half in the caller's.
/// Thread: one caller of run() at a time; made and destroyed while no run() is under way.
class TwoLanes final : public LaneExecutor {
 public:
  /// Starts the lines lane. Error: the thread cannot start (see NamedThread::start).
  static Result<std::unique_ptr<TwoLanes>> start(const ThreadOptions& lines_lane);
  ~TwoLanes() override;

  /// As LaneExecutor::run. If both halves throw, the exception of the points is the one rethrown.
  void run(const std::function<void()>& points, const std::function<void()>& lines) override;

  /// See NamedThread::shortfalls().
  const std::vector<Error>& shortfalls() const { return thread_.shortfalls(); }

 private:
  TwoLanes() = default;
  void lane();
  std::exception_ptr wait_for_lines();

  std::mutex mutex_;
  std::condition_variable posted_;
  std::condition_variable finished_;
  const std::function<void()>* job_ = nullptr;  ///< null: nothing to do, or done
  std::exception_ptr failure_;
  bool ending_ = false;
  NamedThread thread_;  // last, so that it is joined before what it uses goes
};

}  // namespace loopd
