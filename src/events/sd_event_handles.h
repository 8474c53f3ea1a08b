#pragma once

#include <systemd/sd-event.h>

#include <cstdint>
#include <memory>
#include <string>

#include "base/result.h"

namespace loopd {

// For the .cpp files of this folder and the headers private to it: sd-event's handles, owned.

struct SourceUnref {
  void operator()(sd_event_source* source) const { sd_event_source_disable_unref(source); }
};
using EventSource = std::unique_ptr<sd_event_source, SourceUnref>;

struct LoopUnref {
  void operator()(sd_event* loop) const { sd_event_unref(loop); }
};
using LoopReference = std::unique_ptr<sd_event, LoopUnref>;

/// Has `handler` called with `self` whenever `fd` is ready for `events` (EPOLLIN, ...). `what` is
/// named in the error. Thread: that of the loop.
Result<EventSource> watch_fd(sd_event* loop, int fd, std::uint32_t events,
                             sd_event_io_handler_t handler, void* self, const std::string& what);

/// A timer that is off until start_timer(). Thread: that of the loop.
Result<EventSource> make_timer(sd_event* loop, sd_event_time_handler_t handler, void* self,
                               const std::string& what);
/// Lets `timer` elapse once, `delay_us` from now.
void start_timer(const EventSource& timer, std::uint64_t delay_us);

}  // namespace loopd
