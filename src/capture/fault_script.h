#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace loopd {

enum class FaultKind : std::uint8_t { kStall, kDrop, kCorrupt, kUnplug, kJump };

/// One scripted fault. `frame` is the Frame::sequence at which it strikes.
struct Fault {
  FaultKind kind = FaultKind::kStall;
  std::uint64_t frame = 0;
  std::int64_t duration_ns = 0;  ///< stall, unplug: >= 0; jump: signed
  std::uint64_t count = 0;       ///< drop, corrupt: frames hit, >= 1
};

/// The faults that a file camera plays, in the order of their frames.
///
///     script   = [ fault { (" " | ",") fault } ]
///     fault    = "stall@" frame ":" duration      no frame for that time, then it goes on
///              | "drop@" frame [ ":" count ]      frames vanish: a gap in the sequence numbers
///              | "corrupt@" frame [ ":" count ]   their files are cut in half before decoding
///              | "unplug@" frame ":" duration     the camera is gone for that time
///              | "jump@" frame ":" ["+"|"-"] duration   times jump from that frame on, for good
///     frame    = sequence number (0-based; goes on growing when looping)
///     count    = 1 to 1000000, 1 if not given
///     duration = number, with decimals or not, and "ms", "s", "min" or "h", at most 1000000 h
///
/// Stalls and unplugs move the later frames, they lose none. A stall longer than
/// max(1 s, 5 frame times) is reported as kStalled once for each such time. A frame may have
/// several faults. Thread: as its owner.
class FaultScript {
 public:
  FaultScript() = default;

  /// Errors: one sentence that lists every mistake.
  static Result<FaultScript> parse(std::string_view script);

  /// Forgets what is scripted for frames before `frame`.
  void discard_before(std::uint64_t frame);

  /// The next stall or unplug at or before `frame`, each returned once; null if there is none.
  const Fault* take_break(std::uint64_t frame);

  /// The first frame from `frame` on that is not scripted to be dropped.
  std::uint64_t after_drops(std::uint64_t frame) const;

  bool corrupts(std::uint64_t frame) const;

  /// Sum of the jumps at or before `frame`; saturates.
  std::int64_t jump_ns(std::uint64_t frame) const;

  const std::vector<Fault>& faults() const { return faults_; }

 private:
  std::vector<Fault> faults_;   ///< by frame, equal frames in the order of the script
  std::size_t next_break_ = 0;  ///< index of the first fault that take_break() has not seen
};

/// a + b, held at the ends of the range.
std::int64_t saturating_add(std::int64_t a, std::int64_t b);

}  // namespace loopd
