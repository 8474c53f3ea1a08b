#include "capture/interrupt.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>

#include "base/clock.h"

namespace loopd {

Interrupt::Interrupt() : event_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (!event_.valid()) throw std::system_error(errno, std::generic_category(), "eventfd");
}

void Interrupt::request() {
  stop_.request_stop();
  const std::uint64_t one = 1;
  // Cannot fail but by a full counter, and then it is readable already.
  [[maybe_unused]] const ssize_t written = ::write(event_.get(), &one, sizeof one);
}

bool Interrupt::wait_until(std::int64_t deadline_ns) const {
  return wait_readable(-1, deadline_ns) == Ready::kTimeout;
}

Interrupt::Ready Interrupt::wait_readable(int fd, std::int64_t deadline_ns) const {
  // A negative descriptor is skipped by poll.
  std::array<pollfd, 2> fds{{{event_.get(), POLLIN, 0}, {fd, POLLIN, 0}}};
  while (true) {
    const std::int64_t left_ns = std::max<std::int64_t>(deadline_ns - monotonic_now_ns(), 0);
    const timespec timeout{left_ns / 1'000'000'000, left_ns % 1'000'000'000};
    const int ready = ::ppoll(fds.data(), fds.size(), &timeout, nullptr);
    if (requested()) return Ready::kInterrupted;
    if (ready > 0 && fds[1].revents != 0) return Ready::kReadable;
    if (ready == 0 && monotonic_now_ns() >= deadline_ns) return Ready::kTimeout;
  }
}

}  // namespace loopd
