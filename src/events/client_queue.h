#pragma once

#include <sys/uio.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "events/records.h"

namespace loopd {

/// One record as sent, newline included; made once, shared by the queues of all clients.
using RecordText = std::shared_ptr<const std::string>;

/// `text` and its newline.
RecordText shared_line(std::string text);

/// What one client is yet to be sent, bounded in bytes. A record that does not fit, and all that
/// follow until the client has read half of its queue, are counted and told as one gap.
/// Thread: one owner at a time.
class ClientQueue {
 public:
  explicit ClientQueue(std::size_t max_bytes) : max_bytes_(max_bytes) {}

  /// Takes a published record if it fits (into an empty queue anything does); else counts it as
  /// missed. Returns whether it was taken.
  bool offer(const RecordText& text, std::uint64_t seq);
  /// Takes an answer to this client, whatever is queued: the caller stops reading requests while
  /// full(), so answers are bounded too. `seq`: of the published record it is, if it is one.
  void push(RecordText text, std::optional<std::uint64_t> seq = std::nullopt);
  /// Whether offer() would take a record of this size.
  bool has_room(std::size_t bytes) const {
    return gap_.count == 0 && (empty() || bytes_ + bytes <= max_bytes_);
  }

  /// Whether the client has read enough to be told what it missed. Only at half: one that reads
  /// slowly gets long unbroken runs, not a gap per record.
  bool may_tell_gap() const { return bytes_ <= max_bytes_ / 2; }

  /// The next bytes to send: fills `parts` from the front, returns how many were filled.
  std::size_t gather(std::span<iovec> parts) const;
  /// The first text, or what is left of it. Precondition: not empty().
  const RecordText& front() const { return texts_.front().text; }
  std::optional<std::uint64_t> front_seq() const { return texts_.front().seq; }
  /// Puts `text`, which is no published record, where the first one is. Precondition: nothing of
  /// that one is sent.
  void replace_front(RecordText text);
  /// Forgets `sent` bytes. Returns the gap to be told now, if the client has read enough for that;
  /// push() its text at once.
  std::optional<Gap> consume(std::size_t sent);
  /// The gap that is waiting to be told, if any; push() its text at once.
  std::optional<Gap> take_gap();

  bool empty() const { return texts_.empty(); }
  std::size_t bytes() const { return bytes_; }
  /// Refusing: records are being missed, or there is no room for another.
  bool full() const { return gap_.count > 0 || bytes_ >= max_bytes_; }

 private:
  struct Queued {
    RecordText text;
    std::optional<std::uint64_t> seq;
  };

  std::size_t max_bytes_;
  std::deque<Queued> texts_;
  std::size_t front_sent_ = 0;  ///< bytes of texts_.front() already sent
  std::size_t bytes_ = 0;       ///< still to be sent
  Gap gap_;                     ///< count 0: none
};

}  // namespace loopd
