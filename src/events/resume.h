#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "events/epoch_ledger.h"
#include "events/history.h"
#include "events/records.h"

namespace loopd {

/// What a client that was away is to get before the live records.
struct ResumePlan {
  Resumed answer;          ///< for the `watch` record
  std::vector<Loss> gaps;  ///< to be told first; at most one of older epochs and one of this one
  std::uint64_t from = 0;  ///< seq of the first record to send again; newest + 1: none
};

/// Where a client that has seen all up to `since` and watches `classes` goes on. `ledger` has
/// counted every record in `history`, and history.oldest() is not before the current epoch.
/// Reentrant.
ResumePlan plan_resume(const Since& since, ClassSet classes, std::string_view epoch,
                       const EpochLedger& ledger, const History& history);

/// The records of the current epoch from seq `first` up to, not including, `end`, of which nothing
/// is kept any more; none if there are none of `classes`.
std::optional<Loss> loss_in_epoch(std::uint64_t first, std::uint64_t end, ClassSet classes,
                                  const EpochLedger& ledger);

}  // namespace loopd
