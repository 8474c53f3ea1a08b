#pragma once

#include <exception>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "base/result.h"

namespace loopd {

/// How a thread runs.
struct ThreadOptions {
  std::string name{};  ///< as in `top -H`; the kernel keeps the first 15 bytes. Empty: unchanged
  std::vector<int> cpus{};  ///< the CPUs it may run on; empty: all the process may use
  int priority = 0;         ///< 0: the ordinary scheduler; 1..99: SCHED_FIFO with this priority
  /// True: a thread that cannot have these CPUs and this priority does not start.
  bool required = false;
};

/// Applies `options` to the calling thread. Returns what could not be had, one Error each with its
/// remedy; the rest is applied. Thread-safe.
std::vector<Error> configure_this_thread(const ThreadOptions& options);

/// A thread with a name, CPUs, a priority, all signals blocked, and one catch at its top. Joined by
/// its destructor: the owner first makes the body return. Move-only. Thread: one owner.
class NamedThread {
 public:
  /// Called in the dying thread if `body` throws.
  using OnException = std::function<void(const std::string& name, std::exception_ptr)>;

  NamedThread() = default;

  /// Starts a thread and returns once its options are applied; `body` runs after that. Error: no
  /// thread could be made, or `options.required` and something could not be had.
  static Result<NamedThread> start(const ThreadOptions& options, std::function<void()> body,
                                   OnException on_exception);

  ~NamedThread() { join(); }
  NamedThread(NamedThread&&) noexcept = default;
  NamedThread& operator=(NamedThread&& other) noexcept;

  /// Waits for the body to return. May be called any number of times.
  void join();

  bool running() const { return thread_.joinable(); }

  /// What `options` asked for and could not be had (the thread runs without it).
  const std::vector<Error>& shortfalls() const { return shortfalls_; }

 private:
  std::thread thread_;
  std::vector<Error> shortfalls_;
};

}  // namespace loopd
