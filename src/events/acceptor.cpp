#include "events/acceptor.h"

#include <sys/epoll.h>
#include <sys/socket.h>

#include <cerrno>
#include <utility>

namespace loopd {

namespace {

constexpr std::uint64_t kRetryUs = 1'000'000;

}  // namespace

Result<std::unique_ptr<Acceptor>> Acceptor::start(sd_event* loop, ListeningSocket socket, int burst,
                                                  Actions actions) {
  std::unique_ptr<Acceptor> acceptor(new Acceptor(std::move(socket), burst, std::move(actions)));
  const std::string what = "a listening socket";
  auto ready = watch_fd(loop, acceptor->socket_.fd(), EPOLLIN, on_ready, acceptor.get(), what);
  if (!ready) return ready.error();
  acceptor->ready_ = std::move(ready).value();
  auto retry = make_timer(loop, on_retry, acceptor.get(), what);
  if (!retry) return retry.error();
  acceptor->retry_ = std::move(retry).value();
  return acceptor;
}

int Acceptor::on_ready(sd_event_source*, int, std::uint32_t, void* self) {
  static_cast<Acceptor*>(self)->accept_some();
  return 0;
}

void Acceptor::accept_some() {
  for (int i = 0; i < burst_; ++i) {
    UniqueFd fd(accept4(socket_.fd(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (fd.valid()) {
      actions_.take(std::move(fd));
    } else if (errno != ECONNABORTED && errno != EINTR) {
      if (errno != EAGAIN) pause();
      break;
    }
  }
  actions_.done();
}

/// Out of descriptors or memory: the waiting connection would wake the loop without end.
void Acceptor::pause() {
  sd_event_source_set_enabled(ready_.get(), SD_EVENT_OFF);
  start_timer(retry_, kRetryUs);
}

int Acceptor::on_retry(sd_event_source*, std::uint64_t, void* self) {
  sd_event_source_set_enabled(static_cast<Acceptor*>(self)->ready_.get(), SD_EVENT_ON);
  return 0;
}

}  // namespace loopd
