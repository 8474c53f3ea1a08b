#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "base/result.h"
#include "base/unique_fd.h"
#include "events/control_request.h"
#include "events/listening_socket.h"

typedef struct sd_event sd_event;

namespace loopd {

struct ControlOptions {
  std::string socket_path;  ///< its folder must exist; at most 107 bytes (the kernel's limit)
  mode_t mode = 0660;       ///< of the socket file: its owner and group may connect
  int max_clients = 8;
  std::size_t client_queue_bytes = 64 * 1024;
  std::size_t max_line_bytes = 4 * 1024;
  /// A client whose queue is full and who has read nothing for this long is disconnected.
  std::chrono::milliseconds stalled_client{10'000};
  int max_client_errors = 16;  ///< bad requests until a client is disconnected
};

/// What somebody asks the daemon to do. Move-only.
struct ControlRequest {
  ControlOp op = ControlOp::kStatus;
  RecordLimits limits;       ///< kRecord: what bounds it
  UniqueFd file;             ///< kRecord: a regular file open for writing; else none
  std::uint64_t client = 0;  ///< for ControlServer::send(); never used twice
  pid_t pid = 0;             ///< who it is, as the kernel knew when it connected
  uid_t uid = 0;
};

/// What is answered: done, with what there is to say, or not, and why.
struct ControlReply {
  ControlFields fields;
  std::string error{};  ///< one sentence; empty: done

  static ControlReply refusal(std::string why) { return {{}, std::move(why)}; }
};

/// What the daemon does for those who control it. None may throw, nor destroy the server.
struct ControlActions {
  /// Carries out one request. Must not block: events wait meanwhile.
  std::function<ControlReply(ControlRequest)> handle;
  /// The client has left, and with it the right to go on recording into its file.
  std::function<void(std::uint64_t client)> gone;
};

/// The socket that changes what the daemon does, for its owner and group: newline-delimited JSON
/// (docs/protocol.md), a line asked, a line answered. As hostile clients are met as by EventServer;
/// descriptors that are passed and not wanted are closed.
/// Thread: bound to the thread that runs the sd-event loop.
class ControlServer {
 public:
  /// Starts to listen on options.socket_path as part of `loop`, which is referenced until
  /// destruction, or on the socket for that path among `inherited`. Errors: as EventServer.
  static Result<std::unique_ptr<ControlServer>> listen(sd_event* loop,
                                                       const ControlOptions& options,
                                                       ControlActions actions,
                                                       InheritedSockets* inherited = nullptr);
  /// Closes every client, without ControlActions::gone, and removes the socket file.
  ~ControlServer();
  ControlServer(const ControlServer&) = delete;
  ControlServer& operator=(const ControlServer&) = delete;

  /// Tells a client what has come of its request: {"class":<record_class>,...fields}. Returns
  /// whether it is still there. May be called by ControlActions.
  bool send(std::uint64_t client, std::string_view record_class, const ControlFields& fields);

  std::size_t clients() const;       ///< connected now
  std::size_t queued_bytes() const;  ///< not yet taken by the kernel

 private:
  class Impl;
  explicit ControlServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace loopd
