#include "app/wakeup.h"

#include <sys/eventfd.h>

#include <cerrno>
#include <cstdint>

namespace loopd {

Result<Wakeup> Wakeup::make() {
  UniqueFd fd(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (!fd.valid()) return errno_error("cannot make an eventfd; raise LimitNOFILE=", errno);
  return Wakeup(std::move(fd));
}

// Neither can fail in a way that matters: a counter too full to add to, or empty, says what it
// should.
void Wakeup::wake() const { [[maybe_unused]] const int result = eventfd_write(fd_.get(), 1); }

void Wakeup::drain() const {
  eventfd_t count = 0;
  [[maybe_unused]] const int result = eventfd_read(fd_.get(), &count);
}

}  // namespace loopd
