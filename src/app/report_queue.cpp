#include "app/report_queue.h"

namespace loopd {

ReportQueue::ReportQueue(std::size_t slots, bool blocking)
    : blocking_(blocking), slots_(slots), free_(slots), given_(slots) {
  for (TakenReport& slot : slots_) free_.try_push(&slot);
}

bool ReportQueue::give(const Report& report, const ReportOrigin& origin) {
  TakenReport* const slot = free_slot(report.outcome);
  if (slot == nullptr) {
    dropped_.fetch_add(1, std::memory_order_relaxed);
    return false;
  }
  slot->report = report;
  slot->origin = origin;
  return given_.try_push(slot);  // never full: there are as many places as slots
}

ReportQueue::Lent ReportQueue::take() {
  const std::optional<TakenReport*> slot = given_.try_pop();
  return Lent(slot.value_or(nullptr), GiveBack{this});
}

TakenReport* ReportQueue::free_slot(Outcome outcome) {
  if (blocking_) return free_.pop().value_or(nullptr);
  const bool may_use_all = outcome == Outcome::kLoop;
  if (!may_use_all && free_.size() <= free_.capacity() / 4) return nullptr;
  return free_.try_pop().value_or(nullptr);
}

}  // namespace loopd
