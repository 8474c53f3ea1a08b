#include "loopctl/record.h"

#include <chrono>
#include <optional>

#include "loopctl/control.h"
#include "loopctl/stop_signals.h"

namespace loopd::loopctl {

namespace {

using std::chrono::milliseconds;

constexpr milliseconds kAnswer{10'000};
constexpr milliseconds kProgress{1000};
constexpr milliseconds kUnhurried = std::chrono::hours(1);
/// After a stop, the daemon writes what it still holds, at most a few tens of MiB; the disk may be
/// slow.
constexpr milliseconds kLastFrames{60'000};

std::string reason_text(const Json& recorded) {
  const std::string reason = text_of(recorded, "reason");
  if (reason == "stopped") return "stopped";
  if (reason == "time") return "its time is over";
  if (reason == "size") return "as large as it may be";
  if (reason == "frames") return "as many frames as it may have";
  if (const Json& message = member(recorded, "message"); message.is_string())
    return text_of(message);
  return reason;
}

bool is_recorded(const Json& record) { return text_of(record, "class") == "recorded"; }

/// One recording, from the daemon's consent to its end.
class Recording {
 public:
  Recording(ControlClient& client, const RecordCommand& command, const StopSignals& signals,
            std::ostream& err)
      : client_(client), command_(command), signals_(signals), err_(err) {}

  /// The daemon's `recorded`. Errors: the connection broke, no end in time, a second signal.
  Result<Json> wait() {
    while (true) {
      auto text = client_.next(command_.progress ? kProgress : kUnhurried, signals_.fd());
      if (!text) return text.error();
      if (text.value()) {
        Json record = parse_json(*text.value());
        if (is_recorded(record)) return record;
      } else if (signals_.take()) {
        return stop();
      } else if (command_.progress) {
        tell_progress();
      }
    }
  }

 private:
  Result<Json> stop() {
    // Refused if it has just ended by itself: then `recorded` is on its way all the same.
    const Result<std::string> stopped = client_.request(ControlOp::kStopRecord, kAnswer);
    if (!stopped && stopped.error().code != 0) return stopped.error();
    const auto deadline = std::chrono::steady_clock::now() + kLastFrames;
    while (true) {
      const auto left =
          std::chrono::ceil<milliseconds>(deadline - std::chrono::steady_clock::now());
      auto text = client_.next(left, signals_.fd());
      if (!text) return text.error();
      if (!text.value()) return Error{"the recording was stopped, but its end was not awaited", 0};
      Json record = parse_json(*text.value());
      if (is_recorded(record)) return record;
    }
  }

  void tell_progress() {
    const Result<std::string> answer = client_.request(ControlOp::kStatus, kAnswer);
    if (!answer) return;  // that the connection broke is told by next()
    const Json status = parse_json(answer.value());
    if (member(status, "recording_frames").is_null()) return;
    err_ << text_of(status, "recording_frames") << " frames, "
         << mib(member(status, "recording_bytes")) << ", " << text_of(status, "recording_lost")
         << " lost" << std::endl;
  }

  ControlClient& client_;
  const RecordCommand& command_;
  const StopSignals& signals_;
  std::ostream& err_;
};

std::string limits_text(const RecordLimits& limits) {
  return "at most " + decimal(limits.seconds, limits.seconds < 10 ? 1 : 0) + " s and " +
         std::to_string(limits.max_bytes >> 20) + " MiB";
}

/// Asks the daemon to begin; the file stays if it does.
Status begin(ControlClient& client, const RecordCommand& command) {
  Result<NewRecording> file = NewRecording::create(command.file, command.force);
  if (!file) return file.error();
  const Result<std::string> begun =
      client.request(ControlOp::kRecord, kAnswer, command.limits, file->fd());
  if (!begun) return begun.error();
  return file->keep();
}

Result<Json> record_to_the_end(const RecordCommand& command, std::ostream& out, std::ostream& err) {
  const StopSignals signals;  // before the start: a signal right after it must not be lost
  Result<ControlClient> client = connect_control(command.control_path);
  if (!client) return client.error();
  if (const Status begun = begin(*client, command); !begun) return begun.error();
  out << "recording to " << printable(command.file) << ", " << limits_text(command.limits)
      << "; Ctrl-C ends it" << std::endl;
  return Recording(*client, command, signals, err).wait();
}

}  // namespace

bool is_complete(const Json& recorded) {
  const std::string reason = text_of(recorded, "reason");
  const bool as_asked =
      reason == "stopped" || reason == "time" || reason == "size" || reason == "frames";
  return as_asked && number_of(recorded, "lost", 1) == 0 && number_of(recorded, "frames") > 0;
}

std::string recorded_text(const Json& recorded, const std::string& file) {
  std::string text = "recorded " + text_of(recorded, "frames") + " frames, " +
                     mib(member(recorded, "bytes")) + ", in " + printable(file) + ": " +
                     reason_text(recorded);
  if (number_of(recorded, "lost") > 0)
    text += "; " + text_of(recorded, "lost") + " frames are missing, the disk was too slow or full";
  if (number_of(recorded, "frames") == 0) text += "; the camera gave no image, see loopctl status";
  return text;
}

int record(const RecordCommand& command, std::ostream& out, std::ostream& err) {
  const Result<Json> recorded = record_to_the_end(command, out, err);
  if (!recorded) {
    err << "loopctl: " << printable(recorded.error().message) << std::endl;
    return 1;
  }
  out << recorded_text(recorded.value(), command.file) << std::endl;
  if (number_of(recorded.value(), "frames") > 0) {
    out << "play it with: loopd --set camera.path=FILE, or loopeval run FILE" << std::endl;
  }
  return is_complete(recorded.value()) && out ? 0 : 1;
}

}  // namespace loopd::loopctl
