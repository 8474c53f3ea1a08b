#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "loopd/report.h"

namespace loopd {

// What travels over the event socket, as plain values, and its text: one JSON object a record, one
// record a line (docs/protocol.md). All functions are reentrant; none throws but std::bad_alloc.
// Numbers that are not finite are left out, like everything else that is not known; strings that
// are not UTF-8 get U+FFFD where they are wrong.

inline constexpr int kProtocolMajor = 1;
inline constexpr int kProtocolMinor = 1;

/// The kinds of record that are published and can be watched.
enum class RecordClass : std::uint8_t { kLoop, kCandidate, kState, kStats };
inline constexpr std::size_t kRecordClasses = 4;

/// "loop", "candidate", "state", "stats".
std::string_view record_class_name(RecordClass record_class);
std::optional<RecordClass> record_class_from_name(std::string_view name);

/// A set of record classes.
class ClassSet {
 public:
  constexpr ClassSet() = default;
  constexpr ClassSet(std::initializer_list<RecordClass> classes) {
    for (RecordClass c : classes) add(c);
  }
  constexpr void add(RecordClass c) { bits_ |= 1u << static_cast<unsigned>(c); }
  constexpr bool has(RecordClass c) const { return (bits_ >> static_cast<unsigned>(c) & 1u) != 0; }
  constexpr bool empty() const { return bits_ == 0; }
  friend bool operator==(const ClassSet&, const ClassSet&) = default;

 private:
  unsigned bits_ = 0;
};

/// Who speaks: told to every client in `hello`.
struct Identity {
  std::string version;  ///< of loopd
  std::string camera;   ///< configured name, "front"
  /// New at every start of the daemon and whenever its map is emptied; image ids belong to it. At
  /// most 63 bytes, or clients are not told exactly what they missed.
  std::string epoch;
  std::string boot_id;              ///< /proc/sys/kernel/random/boot_id, no newline
  std::string clock = "monotonic";  ///< the clock of every time_ns
};

/// Where a record stands in the daemon's stream. The seq grows by one per published record.
struct StreamPosition {
  std::string_view epoch;
  std::uint64_t seq = 0;
};

/// What a Report alone cannot tell about the age of an event.
struct Latency {
  /// From the capture instant to the detector taking the frame; none where the camera's times are
  /// not of the daemon's clock (a recording).
  std::optional<std::int64_t> capture_ns;
  /// From the capture instant (if that is unknown: from the detector taking the frame) to the call
  /// of publish().
  std::optional<std::int64_t> total_ns;
};

enum class State : std::uint8_t {
  kStarting,       ///< not yet a frame
  kRunning,        ///< frames arrive and are processed
  kCameraLost,     ///< the device is gone; the daemon keeps trying to open it
  kCameraBack,     ///< running again after lost or stalled
  kCameraStalled,  ///< the device is there but gives no frames
  kCameraEnd,      ///< a recording has come to its end
  kDetectorError,  ///< frames keep failing in the detector
  kPaused,         ///< told to rest: images are thrown away until told to go on
  kMapReset,       ///< all images and words were forgotten on request: the first of a new epoch
  kShuttingDown,   ///< the last record of an epoch
};

/// "starting", "running", "camera_lost", "camera_back", "camera_stalled", "camera_end",
/// "detector_error", "paused", "map_reset", "shutting_down".
std::string_view state_name(State state);

/// A change of the daemon's state; the newest one is the current state.
struct StateRecord {
  State state = State::kStarting;
  std::int64_t time_ns = 0;  ///< CLOCK_MONOTONIC when it began
  std::string cause;         ///< one sentence: what happened, to what, why; empty if nothing to say
  std::string remedy;        ///< what a person can do about it; empty if nothing needs doing
  std::string fault{};       ///< stable name of what is wrong with the camera; empty if nothing is
};

/// Counters since the daemon's start, and means since the previous stats record.
struct StatsRecord {
  std::int64_t time_ns = 0;    ///< CLOCK_MONOTONIC when taken
  std::int64_t uptime_ns = 0;  ///< since the daemon's start
  std::uint64_t frames = 0;    ///< given to the detector
  std::uint64_t dropped = 0;   ///< lost before the detector: driver gaps and frames too old to keep
  std::uint64_t corrupt = 0;   ///< refused because their content could not be decoded
  std::uint64_t errors = 0;    ///< frames with Outcome::kError
  std::uint64_t loops = 0;
  std::uint64_t candidates = 0;  ///< reached verification and were rejected
  std::size_t images = 0;        ///< searchable
  std::size_t words_points = 0;
  std::size_t words_lines = 0;
  std::size_t bytes = 0;                  ///< of the map in use
  std::size_t budget_bytes = 0;           ///< of the map when it is full
  Evictions evictions;                    ///< images forgotten since the map was empty
  std::uint64_t restamped = 0;            ///< frames whose time of capture had to be replaced
  std::uint64_t camera_losses = 0;        ///< times that the camera was lost
  std::optional<double> frame_rate_hz;    ///< of processed frames, since the previous record
  std::optional<StageTimes> stage_means;  ///< per frame, since the previous record
};

/// What the server itself adds to a stats record.
struct ServerStats {
  std::size_t clients = 0;
  std::uint64_t missed_records = 0;  ///< records that slow clients did not get, all clients summed
};

/// A client's `since`: the newest record it has seen.
struct Since {
  std::string epoch;
  std::uint64_t seq = 0;
};

/// A client's `{"op":"watch",...}`.
struct WatchRequest {
  ClassSet classes{RecordClass::kLoop, RecordClass::kState};
  bool pairs = false;
  std::optional<Since> since;
};

/// A request understood, or why not.
struct ParsedRequest {
  std::optional<WatchRequest> watch;
  std::string error;  ///< one sentence for the client, if not
};

/// Limits in force for a client; echoed by `watch`.
struct ClientPolicy {
  std::size_t queue_bytes = 0;
  std::size_t max_line_bytes = 0;
  std::int64_t stalled_client_ms = 0;
  std::size_t history_bytes = 0;
};

/// What `watch` answers to a `since`.
struct Resumed {
  bool complete = false;                ///< every record since then has been or will be sent
  std::optional<std::uint64_t> missed;  ///< published since then, of all classes, if known
  std::string reason;                   ///< one sentence, if not complete
};

/// Records a slow client did not get.
struct Gap {
  std::uint64_t count = 0;
  std::uint64_t first_seq = 0;
  std::uint64_t last_seq = 0;
};

/// Records a client did not get, as told in `gap`, as far as that is known.
struct Loss {
  std::optional<std::uint64_t> count;      ///< of the classes it watches
  std::optional<std::uint64_t> first_seq;  ///< they lie between these, both included
  std::optional<std::uint64_t> last_seq;
  std::string of_epoch{};  ///< which first_seq and last_seq belong to; empty: the current one
};

/// Which record a report becomes: loop; candidate if one reached verification and was rejected;
/// else none.
std::optional<RecordClass> record_class_of(const Report& report);

// The text of one record, without the newline.

std::string hello_text(const Identity& identity, StreamPosition position);
/// `resumed`: the answer to request.since; ignored if that was not given.
std::string watch_text(const WatchRequest& request, const ClientPolicy& policy,
                       StreamPosition position, const Resumed& resumed = {});
std::string gap_text(const Gap& gap, StreamPosition position);
std::string gap_text(const Loss& loss, StreamPosition position);
std::string error_text(std::string_view message, StreamPosition position);
/// Precondition: record_class_of(report). `pairs`: with the inlier pairs, the long form.
std::string report_text(const Report& report, const Latency& latency, StreamPosition position,
                        bool pairs);
/// `repeat`: an older record sent again to a client that has just started to watch.
std::string state_text(const StateRecord& record, StreamPosition position, bool repeat);
std::string stats_text(const StatsRecord& record, const ServerStats& server,
                       StreamPosition position, bool repeat);

/// A client's `watch` request, the inverse of parse_request().
std::string request_text(const WatchRequest& request);

/// Reads one line of a client, without its newline. Any bytes are answered: nesting is bounded
/// before the parser runs.
ParsedRequest parse_request(std::string_view line);

}  // namespace loopd
