#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/bounded_queue.h"
#include "base/log.h"
#include "events/records.h"

namespace loopd {

/// Something a worker thread has to say to the log and, if it is a change of state, to clients.
struct Notice {
  LogLevel level = LogLevel::kNotice;
  StateRecord record;
  bool is_state = true;  ///< false: for the log only; record.state means nothing
};

/// Carries notices from the worker threads to the event loop. Drop policy: the oldest gives way,
/// so the newest state always arrives; nobody waits. Thread-safe.
class NoticeQueue {
 public:
  static constexpr std::size_t kCapacity = 64;

  void give(const Notice& notice) {
    while (!queue_.try_push(notice)) queue_.try_pop();
  }
  std::optional<Notice> take() { return queue_.try_pop(); }

 private:
  BoundedQueue<Notice> queue_{kCapacity};
};

}  // namespace loopd
