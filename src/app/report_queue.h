#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "base/bounded_queue.h"
#include "loopd/report.h"

namespace loopd {

/// What only the giver of a report knows of it.
struct ReportOrigin {
  std::int64_t taken_ns = 0;  ///< CLOCK_MONOTONIC when the detector took the frame
  /// The frame's capture time, where it is of the daemon's own clock.
  std::optional<std::int64_t> captured_ns;
  std::uint32_t map = 0;  ///< which map its image ids belong to: resets before it
};

/// A report on its way to the clients.
struct TakenReport {
  Report report;
  ReportOrigin origin;
};

/// Carries reports from the detector to the event loop in a fixed number of slots allocated at the
/// start. Thread: one giver, one taker; close() and dropped() by any.
///
/// Drop policy: with `blocking` (lock-step) the giver waits and nothing is dropped. Without, the
/// new report is dropped and counted when no slot is free, and a rejected candidate already when
/// only a quarter is left, so that these never cost a loop its place.
class ReportQueue {
 public:
  struct GiveBack {
    ReportQueue* queue = nullptr;
    void operator()(TakenReport* slot) const { queue->free_.try_push(slot); }
  };
  /// A report taken; its slot is free again on destruction. Must not outlive the queue.
  using Lent = std::unique_ptr<TakenReport, GiveBack>;

  /// Precondition: slots >= 1.
  ReportQueue(std::size_t slots, bool blocking);

  /// Hands over a copy of `report`. False if it was dropped, or the queue is closed.
  bool give(const Report& report, const ReportOrigin& origin);

  /// The oldest report given; empty if there is none right now.
  Lent take();

  /// From now on nothing is given; a giver that waits returns. What was given can still be taken.
  void close() { free_.close(); }

  std::uint64_t dropped() const { return dropped_.load(std::memory_order_relaxed); }
  static std::size_t bytes(std::size_t slots) { return slots * sizeof(TakenReport); }

 private:
  TakenReport* free_slot(Outcome outcome);

  const bool blocking_;
  std::vector<TakenReport> slots_;
  BoundedQueue<TakenReport*> free_;
  BoundedQueue<TakenReport*> given_;
  std::atomic<std::uint64_t> dropped_ = 0;
};

}  // namespace loopd
