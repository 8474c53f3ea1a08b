#include "capture/libcamera_completions.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cassert>

namespace loopd {

CompletionBoard::CompletionBoard() : event_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}

void CompletionBoard::finish(std::size_t index) {
  assert(index < kMaxBuffers);
  done_.fetch_or(std::uint32_t{1} << index, std::memory_order_release);
  wake();
}

void CompletionBoard::disconnect() {
  disconnected_.store(true, std::memory_order_release);
  wake();
}

std::uint32_t CompletionBoard::take() {
  std::uint64_t count = 0;
  // The event before the bits: what is finished in between leaves the event set, not lost.
  [[maybe_unused]] const ssize_t got = ::read(event_.get(), &count, sizeof count);
  return done_.exchange(0, std::memory_order_acquire);
}

void CompletionBoard::wake() {
  const std::uint64_t one = 1;
  // Cannot fail but by a full counter, and then it is readable already.
  [[maybe_unused]] const ssize_t written = ::write(event_.get(), &one, sizeof one);
}

}  // namespace loopd
