#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <utility>

namespace loopd {

/// One slot between one giver and one taker. Drop policy: the newest value wins, and what it
/// overwrites is destroyed (in the giver's thread) and counted. Thread-safe.
template <class T>
class Mailbox {
 public:
  /// Puts `value` in the slot at once, in place of an older one nobody took. False (and `value` is
  /// destroyed) if closed.
  bool put(T value) {
    std::optional<T> overwritten;  // destroyed after the lock is released
    {
      const std::lock_guard lock(mutex_);
      if (closed_) return false;
      overwritten.swap(slot_);
      if (overwritten) ++overwritten_;
      slot_.emplace(std::move(value));
    }
    filled_.notify_one();
    return true;
  }

  /// Lock-step: waits until the slot is empty, so that nothing is ever overwritten. False (and
  /// `value` is destroyed) if closed, before or while waiting.
  bool put_when_empty(T value) {
    {
      std::unique_lock lock(mutex_);
      emptied_.wait(lock, [this] { return closed_ || !slot_; });
      if (closed_) return false;
      slot_.emplace(std::move(value));
    }
    filled_.notify_one();
    return true;
  }

  /// Waits for a value and takes it out. Nothing once closed and empty: a value put before close()
  /// is still delivered.
  std::optional<T> take() {
    std::optional<T> value;
    {
      std::unique_lock lock(mutex_);
      filled_.wait(lock, [this] { return closed_ || slot_; });
      value.swap(slot_);
    }
    emptied_.notify_one();
    return value;
  }

  /// Wakes everybody; from now on nothing goes in. May be called any number of times.
  void close() {
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
    }
    filled_.notify_all();
    emptied_.notify_all();
  }

  /// How many values were overwritten untaken, so far.
  std::uint64_t overwritten() const {
    const std::lock_guard lock(mutex_);
    return overwritten_;
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable filled_;
  std::condition_variable emptied_;
  std::optional<T> slot_;
  std::uint64_t overwritten_ = 0;
  bool closed_ = false;
};

}  // namespace loopd
