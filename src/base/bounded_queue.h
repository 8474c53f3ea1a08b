#pragma once

#include <cassert>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

namespace loopd {

/// First in, first out, with a capacity fixed at construction; allocates nothing afterwards (beyond
/// what moving a T does). Drop policy: what is in the queue stays; when full, try_push refuses the
/// new value and tells its caller, who counts. T: default-constructible, movable. Thread-safe.
template <class T>
class BoundedQueue {
 public:
  explicit BoundedQueue(std::size_t capacity) : ring_(capacity) { assert(capacity > 0); }

  std::size_t capacity() const { return ring_.size(); }

  std::size_t size() const {
    const std::lock_guard lock(mutex_);
    return size_;
  }

  /// Appends `value`; false (and `value` is destroyed) if full or closed.
  bool try_push(T value) {
    {
      const std::lock_guard lock(mutex_);
      if (closed_ || size_ == ring_.size()) return false;
      append(std::move(value));
    }
    filled_.notify_one();
    return true;
  }

  /// Waits for room. False (and `value` is destroyed) if closed, before or while waiting.
  bool push(T value) {
    {
      std::unique_lock lock(mutex_);
      emptied_.wait(lock, [this] { return closed_ || size_ < ring_.size(); });
      if (closed_) return false;
      append(std::move(value));
    }
    filled_.notify_one();
    return true;
  }

  /// Takes the oldest value; nothing if there is none right now.
  std::optional<T> try_pop() {
    std::optional<T> value;
    {
      const std::lock_guard lock(mutex_);
      if (size_ == 0) return value;
      value.emplace(remove_oldest());
    }
    emptied_.notify_one();
    return value;
  }

  /// Waits for a value. Nothing once closed and empty: what was pushed before close() still comes.
  std::optional<T> pop() {
    std::optional<T> value;
    {
      std::unique_lock lock(mutex_);
      filled_.wait(lock, [this] { return closed_ || size_ > 0; });
      if (size_ == 0) return value;
      value.emplace(remove_oldest());
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

 private:
  void append(T value) {
    ring_[(first_ + size_) % ring_.size()] = std::move(value);
    ++size_;
  }

  T remove_oldest() {
    T value = std::exchange(ring_[first_], T{});
    first_ = (first_ + 1) % ring_.size();
    --size_;
    return value;
  }

  mutable std::mutex mutex_;
  std::condition_variable filled_;
  std::condition_variable emptied_;
  std::vector<T> ring_;
  std::size_t first_ = 0;
  std::size_t size_ = 0;
  bool closed_ = false;
};

}  // namespace loopd
