#pragma once

#include <systemd/sd-event.h>

#include <cstdint>
#include <exception>
#include <functional>
#include <list>
#include <memory>

#include "base/result.h"

namespace loopd {

/// An sd-event loop whose sources call functions. What a function throws comes out of run_once()
/// and never passes through C code. Thread: bound to the one that makes it.
class EventLoop {
 public:
  using Action = std::function<void()>;

  static Result<std::unique_ptr<EventLoop>> make();
  ~EventLoop();
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;

  /// For sources of other parts; they must be gone before the loop is.
  sd_event* handle() const { return event_; }

  /// Calls `action` for each arrival of `signal`, which must be blocked in every thread.
  Status on_signal(int signal, Action action);
  /// Calls `action` while `fd` is readable, until forget(fd), which comes before it is closed.
  Status on_readable(int fd, Action action);
  /// No more calls for `fd`; may be called by its own action. No-op if nothing waits for it.
  void forget(int fd);
  /// Calls `action` every `interval_us()`, asked for anew each time, the first time after one
  /// interval. Late calls are not made up for.
  Status every(std::function<std::uint64_t()> interval_us, Action action);

  /// Waits for events, at most `timeout_us`, and handles one.
  Status run_once(std::uint64_t timeout_us = UINT64_MAX);

 private:
  struct Source {
    EventLoop* loop = nullptr;
    sd_event_source* source = nullptr;
    Action action;
    std::function<std::uint64_t()> interval_us{};
    int fd = -1;             ///< of on_readable()
    bool forgotten = false;  ///< to be removed
  };

  explicit EventLoop(sd_event* event) : event_(event) {}
  Source& add(Action action);
  void call(Source& source);
  static int signalled(sd_event_source*, const struct signalfd_siginfo*, void* source);
  static int readable(sd_event_source*, int, std::uint32_t, void* source);
  static int elapsed(sd_event_source*, std::uint64_t, void* source);

  sd_event* event_;
  std::list<Source> sources_;  // stable addresses: sd-event keeps pointers to them
  std::exception_ptr thrown_;
};

}  // namespace loopd
