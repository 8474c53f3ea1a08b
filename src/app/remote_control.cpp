#include "app/remote_control.h"

#include <linux/magic.h>
#include <sys/vfs.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "app/message_ids.h"

namespace loopd {
namespace {

constexpr std::uint64_t kMostBytesInMemory = std::uint64_t{128} << 20;

ControlReply done() { return {}; }

std::int64_t signed_of(std::uint64_t value) { return static_cast<std::int64_t>(value); }

/// A file in memory counts as the daemon's own, and must leave room for the map.
bool is_in_memory(const UniqueFd& file) {
  struct statfs status {};
  return fstatfs(file.get(), &status) == 0 &&
         (status.f_type == TMPFS_MAGIC || status.f_type == RAMFS_MAGIC);
}

ControlFields fields_of(const RecordingResult& result) {
  ControlFields fields{{"frames", signed_of(result.frames)},
                       {"bytes", signed_of(result.bytes)},
                       {"lost", signed_of(result.lost)}};
  if (result.end) fields.push_back({"reason", std::string(recording_end_name(*result.end))});
  if (!result.message.empty()) fields.push_back({"message", result.message});
  return fields;
}

}  // namespace

Result<std::unique_ptr<RemoteControl>> RemoteControl::open(
    EventLoop& loop, const std::string& socket_path, Controllable& daemon, RecordingTap& tap,
    RecordingDefaults defaults, const Log& log, InheritedSockets& inherited) {
  std::unique_ptr<RemoteControl> control(
      new RemoteControl(loop, daemon, tap, std::move(defaults), log));
  ControlOptions options;
  options.socket_path = socket_path;
  const ControlActions actions{
      [self = control.get()](ControlRequest request) { return self->handle(std::move(request)); },
      [self = control.get()](std::uint64_t client) { self->gone(client); }};
  auto server = ControlServer::listen(loop.handle(), options, actions, &inherited);
  if (!server) return server.error();
  control->server_ = std::move(server).value();
  return control;
}

ControlReply RemoteControl::handle(ControlRequest request) {
  if (request.op == ControlOp::kStatus) return status();
  log_.write(LogLevel::kNotice, "asked to",
             {{"camera", defaults_.camera},
              {"op", std::string(control_op_name(request.op))},
              {"pid", std::to_string(request.pid)}},  // its user is hidden by PrivateUsers=
             kIdControl);
  switch (request.op) {
    case ControlOp::kPause:
      daemon_.pause();
      return done();
    case ControlOp::kResume:
      daemon_.resume();
      return done();
    case ControlOp::kReset:
      daemon_.reset_map();
      return done();
    case ControlOp::kReload: {
      const Result<std::string> result = daemon_.reload();
      if (!result) return ControlReply::refusal(result.error().message);
      return {.fields = {{"result", result.value()}}};
    }
    case ControlOp::kRecord:
      return record(std::move(request));
    case ControlOp::kStopRecord:
      return stop_recording(request.client);
    case ControlOp::kStatus:
      break;
  }
  return ControlReply::refusal("this version does not know how");
}

ControlReply RemoteControl::status() const {
  ControlFields fields = daemon_.status();
  if (const auto progress = recorder_.progress()) {
    fields.push_back({"recording", true});
    for (ControlField& field : fields_of(*progress)) {
      field.name = "recording_" + field.name;
      fields.push_back(std::move(field));
    }
  }
  return {.fields = std::move(fields)};
}

ControlReply RemoteControl::record(ControlRequest request) {
  RecordingOptions options = defaults_;
  options.limits.duration_ns = std::llround(request.limits.seconds * 1e9);
  options.limits.bytes = request.limits.max_bytes;
  if (is_in_memory(request.file))
    options.limits.bytes = std::min(options.limits.bytes, kMostBytesInMemory);
  const Status started =
      recorder_.start(std::move(request.file), options,
                      [this](const RecordingResult& result) { recorded(result); });
  if (!started) return ControlReply::refusal(started.error().message);
  recording_client_ = request.client;
  return done();
}

ControlReply RemoteControl::stop_recording(std::uint64_t client) {
  if (!recorder_.progress()) return ControlReply::refusal("nothing is being recorded");
  if (recording_client_ != client)
    return ControlReply::refusal("only who began a recording stops it, here or by leaving");
  recorder_.stop();
  return done();
}

/// Who began a recording has left, so nobody waits for it.
void RemoteControl::gone(std::uint64_t client) {
  if (recording_client_ == client) recorder_.stop();
}

void RemoteControl::recorded(const RecordingResult& result) {
  const bool failed = !result.message.empty();
  log_.write(failed ? LogLevel::kWarning : LogLevel::kNotice, "recorded",
             {{"camera", defaults_.camera},
              {"frames", std::to_string(result.frames)},
              {"bytes", std::to_string(result.bytes)},
              {"lost", std::to_string(result.lost)},
              {"reason", std::string(recording_end_name(result.end.value()))},
              {"cause", result.message}},
             kIdRecording);
  server_->send(std::exchange(recording_client_, std::nullopt).value(), "recorded",
                fields_of(result));
}

void RemoteControl::end_recording() { recorder_.finish_now(); }

}  // namespace loopd
