#include "events/sd_event_handles.h"

#include <time.h>

namespace loopd {

namespace {

constexpr std::uint64_t kTimerAccuracyUs = 10'000;

}  // namespace

Result<EventSource> watch_fd(sd_event* loop, int fd, std::uint32_t events,
                             sd_event_io_handler_t handler, void* self, const std::string& what) {
  sd_event_source* source = nullptr;
  const int r = sd_event_add_io(loop, &source, fd, events, handler, self);
  if (r < 0) return errno_error("cannot watch " + what, -r);
  return EventSource(source);
}

Result<EventSource> make_timer(sd_event* loop, sd_event_time_handler_t handler, void* self,
                               const std::string& what) {
  sd_event_source* source = nullptr;
  int r = sd_event_add_time_relative(loop, &source, CLOCK_MONOTONIC, 0, kTimerAccuracyUs, handler,
                                     self);
  EventSource timer(source);
  if (r >= 0) r = sd_event_source_set_enabled(source, SD_EVENT_OFF);
  if (r < 0) return errno_error("cannot make a timer for " + what, -r);
  return timer;
}

void start_timer(const EventSource& timer, std::uint64_t delay_us) {
  sd_event_source_set_time_relative(timer.get(), delay_us);
  sd_event_source_set_enabled(timer.get(), SD_EVENT_ONESHOT);
}

}  // namespace loopd
