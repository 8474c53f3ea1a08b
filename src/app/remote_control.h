#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "app/event_loop.h"
#include "app/recorder.h"
#include "base/log.h"
#include "base/result.h"
#include "events/control_server.h"

namespace loopd {

/// What can be asked of a running daemon.
class Controllable {
 public:
  virtual void pause() = 0;
  virtual void resume() = 0;
  virtual void reset_map() = 0;
  /// One sentence: what was taken over and what was not.
  virtual Result<std::string> reload() = 0;
  virtual ControlFields status() const = 0;

 protected:
  ~Controllable() = default;
};

/// The control socket and what is done for its clients. Thread: that of the event loop.
class RemoteControl {
 public:
  /// What every recording has in common: the names in its header, the thread's options.
  using RecordingDefaults = RecordingOptions;

  /// All references outlive it. Errors: as ControlServer::listen.
  static Result<std::unique_ptr<RemoteControl>> open(EventLoop& loop,
                                                     const std::string& socket_path,
                                                     Controllable& daemon, RecordingTap& tap,
                                                     RecordingDefaults defaults, const Log& log,
                                                     InheritedSockets& inherited);

  /// Ends a recording under way and tells who asked for it.
  void end_recording();

 private:
  RemoteControl(EventLoop& loop, Controllable& daemon, RecordingTap& tap,
                RecordingDefaults defaults, const Log& log)
      : daemon_(daemon), defaults_(std::move(defaults)), log_(log), recorder_(loop, tap) {}

  ControlReply handle(ControlRequest request);
  ControlReply record(ControlRequest request);
  ControlReply stop_recording(std::uint64_t client);
  ControlReply status() const;
  void gone(std::uint64_t client);
  void recorded(const RecordingResult& result);

  Controllable& daemon_;
  const RecordingDefaults defaults_;
  const Log log_;
  Recorder recorder_;
  std::optional<std::uint64_t> recording_client_;
  std::unique_ptr<ControlServer> server_;
};

}  // namespace loopd
