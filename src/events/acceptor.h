#pragma once

#include <functional>
#include <memory>

#include "base/result.h"
#include "base/unique_fd.h"
#include "events/listening_socket.h"
#include "events/sd_event_handles.h"

namespace loopd {

/// Takes connections from a listening socket and hands them on, a bounded number each time the
/// event loop wakes it. Out of descriptors it waits a second instead of spinning.
/// Thread: that of the loop.
class Acceptor {
 public:
  struct Actions {
    std::function<void(UniqueFd)> take;  ///< called for each connection
    std::function<void()> done;          ///< called after some were taken
  };

  /// `burst`: how many are taken at once; the others wait for the next turn of the loop.
  static Result<std::unique_ptr<Acceptor>> start(sd_event* loop, ListeningSocket socket, int burst,
                                                 Actions actions);
  Acceptor(const Acceptor&) = delete;
  Acceptor& operator=(const Acceptor&) = delete;

 private:
  Acceptor(ListeningSocket socket, int burst, Actions actions)
      : socket_(std::move(socket)), burst_(burst), actions_(std::move(actions)) {}
  static int on_ready(sd_event_source*, int fd, std::uint32_t events, void* self);
  static int on_retry(sd_event_source*, std::uint64_t now_us, void* self);
  void accept_some();
  void pause();

  const ListeningSocket socket_;
  const int burst_;
  const Actions actions_;
  EventSource ready_;
  EventSource retry_;
};

}  // namespace loopd
