#include "loopctl/stop_signals.h"

#include <poll.h>
#include <sys/signalfd.h>

#include <csignal>

namespace loopd::loopctl {

StopSignals::StopSignals() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  sigprocmask(SIG_BLOCK, &set, nullptr);
  fd_.reset(signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK));
}

bool StopSignals::take(std::chrono::milliseconds wait) const {
  pollfd ready{fd_.get(), POLLIN, 0};
  if (poll(&ready, 1, static_cast<int>(wait.count())) <= 0) return false;
  signalfd_siginfo signal{};
  return read(fd_.get(), &signal, sizeof signal) == static_cast<ssize_t>(sizeof signal);
}

}  // namespace loopd::loopctl
