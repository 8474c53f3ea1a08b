#include "app/event_loop.h"

#include <sys/epoll.h>
#include <time.h>

#include <string>
#include <utility>

namespace loopd {
namespace {

Status status_of(int result, const std::string& what) {
  if (result < 0) return errno_error("cannot " + what, -result);
  return Nothing{};
}

}  // namespace

Result<std::unique_ptr<EventLoop>> EventLoop::make() {
  sd_event* event = nullptr;
  const int result = sd_event_new(&event);
  if (result < 0) return errno_error("cannot make an event loop", -result);
  return std::unique_ptr<EventLoop>(new EventLoop(event));
}

EventLoop::~EventLoop() {
  for (const Source& source : sources_) sd_event_source_unref(source.source);
  sd_event_unref(event_);
}

Status EventLoop::on_signal(int signal, Action action) {
  Source& source = add(std::move(action));
  return status_of(sd_event_add_signal(event_, &source.source, signal, &signalled, &source),
                   "watch signal " + std::to_string(signal));
}

Status EventLoop::on_readable(int fd, Action action) {
  Source& source = add(std::move(action));
  source.fd = fd;
  return status_of(sd_event_add_io(event_, &source.source, fd, EPOLLIN, &readable, &source),
                   "watch file descriptor " + std::to_string(fd));
}

void EventLoop::forget(int fd) {
  for (Source& source : sources_) {
    if (source.fd != fd || source.source == nullptr) continue;
    source.source = sd_event_source_disable_unref(source.source);
    source.forgotten = true;  // removed later: its action may be under way
  }
}

Status EventLoop::every(std::function<std::uint64_t()> interval_us, Action action) {
  constexpr std::uint64_t kAccuracy_us = 10'000;
  Source& source = add(std::move(action));
  source.interval_us = std::move(interval_us);
  return status_of(
      sd_event_add_time_relative(event_, &source.source, CLOCK_MONOTONIC, source.interval_us(),
                                 kAccuracy_us, &elapsed, &source),
      "set a timer");
}

Status EventLoop::run_once(std::uint64_t timeout_us) {
  sources_.remove_if([](const Source& source) { return source.forgotten; });
  const int result = sd_event_run(event_, timeout_us);
  if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
  return status_of(result, "run the event loop");
}

EventLoop::Source& EventLoop::add(Action action) {
  return sources_.emplace_back(Source{this, nullptr, std::move(action)});
}

void EventLoop::call(Source& source) {
  try {
    source.action();
  } catch (...) {
    thrown_ = std::current_exception();
  }
}

int EventLoop::signalled(sd_event_source*, const struct signalfd_siginfo*, void* source) {
  auto& self = *static_cast<Source*>(source);
  self.loop->call(self);
  return 0;
}

int EventLoop::readable(sd_event_source*, int, std::uint32_t, void* source) {
  auto& self = *static_cast<Source*>(source);
  self.loop->call(self);
  return 0;
}

int EventLoop::elapsed(sd_event_source* timer, std::uint64_t, void* source) {
  auto& self = *static_cast<Source*>(source);
  self.loop->call(self);
  const int result = sd_event_source_set_time_relative(timer, self.interval_us());
  return result < 0 ? result : sd_event_source_set_enabled(timer, SD_EVENT_ONESHOT);
}

}  // namespace loopd
