#include "events/resume.h"

#include <algorithm>

namespace loopd {

namespace {

/// Adds what is lost of the current epoch from seq `first` on, and where the history takes over.
void go_on_from(std::uint64_t first, ClassSet classes, const EpochLedger& ledger,
                const History& history, ResumePlan& plan) {
  plan.from = std::max(first, history.oldest());
  const std::optional<Loss> loss = loss_in_epoch(first, plan.from, classes, ledger);
  if (loss) plan.gaps.push_back(*loss);
}

/// What is lost of the older epochs: all that comes after `since`.
std::optional<Loss> loss_of_older(const Since& since, std::uint64_t index, ClassSet classes,
                                  const EpochLedger& ledger) {
  Loss loss;
  loss.count = ledger.count(index, ledger.epoch_index(), classes);
  if (loss.count == 0u) return std::nullopt;
  loss.of_epoch = since.epoch;
  const std::uint64_t last = ledger.last_seq(since.epoch).value_or(since.seq);
  if (last > since.seq) {  // else they are all of epochs the client has never heard of
    loss.first_seq = since.seq + 1;
    loss.last_seq = last;
  }
  return loss;
}

ResumePlan plan_same_epoch(const Since& since, ClassSet classes, const EpochLedger& ledger,
                           const History& history, std::uint64_t newest) {
  ResumePlan plan;
  if (since.seq > newest) {
    plan.answer.reason = "no such record yet";
    plan.from = newest + 1;
    return plan;
  }
  // A seq of an earlier epoch under the name of this one asks for all of this one.
  const std::uint64_t first = std::max(since.seq + 1, ledger.epoch_first_seq());
  plan.answer.missed = newest + 1 - first;
  go_on_from(first, classes, ledger, history, plan);
  return plan;
}

ResumePlan plan_other_epoch(const Since& since, ClassSet classes, const EpochLedger& ledger,
                            const History& history) {
  ResumePlan plan;
  const std::optional<std::uint64_t> index = ledger.index_after(since);
  if (!index) {
    plan.gaps.emplace_back();
    plan.answer.reason = "that epoch or record is not known here: nobody can tell what is lost";
  } else {
    plan.answer.missed = ledger.next_index() - *index;
    const std::optional<Loss> loss = loss_of_older(since, *index, classes, ledger);
    if (loss) plan.gaps.push_back(*loss);
    if (loss) plan.answer.reason = "records of an older epoch are not kept";
  }
  go_on_from(ledger.epoch_first_seq(), classes, ledger, history, plan);
  return plan;
}

}  // namespace

std::optional<Loss> loss_in_epoch(std::uint64_t first, std::uint64_t end, ClassSet classes,
                                  const EpochLedger& ledger) {
  if (first >= end) return std::nullopt;
  const std::uint64_t base = ledger.epoch_index() - ledger.epoch_first_seq();  // may wrap: modular
  Loss loss;
  loss.count = ledger.count(base + first, base + end, classes);
  if (loss.count == 0u) return std::nullopt;
  loss.first_seq = first;
  loss.last_seq = end - 1;
  return loss;
}

ResumePlan plan_resume(const Since& since, ClassSet classes, std::string_view epoch,
                       const EpochLedger& ledger, const History& history) {
  const std::uint64_t newest =
      ledger.epoch_first_seq() - 1 + ledger.next_index() - ledger.epoch_index();
  ResumePlan plan = since.epoch == epoch ? plan_same_epoch(since, classes, ledger, history, newest)
                                         : plan_other_epoch(since, classes, ledger, history);
  if (plan.answer.reason.empty() && !plan.gaps.empty()) {
    plan.answer.reason = "some of them are older than the history that is kept";
  }
  plan.answer.complete = plan.answer.reason.empty();
  return plan;
}

}  // namespace loopd
