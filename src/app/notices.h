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
  enum class Kind : std::uint8_t {
    kState,      ///< a change of state, for clients too
    kFrameLost,  ///< for the log only, as the rest; record.state means nothing
    kCamera,     ///< something about the camera that changes no state
  };
  LogLevel level = LogLevel::kNotice;
  StateRecord record;
  Kind kind = Kind::kState;

  bool is_state() const { return kind == Kind::kState; }
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
