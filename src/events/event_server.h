#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "base/result.h"
#include "events/listening_socket.h"
#include "events/records.h"
#include "loopd/report.h"

typedef struct sd_event sd_event;

namespace loopd {

struct ServerOptions {
  std::string socket_path;  ///< its folder must exist; at most 107 bytes (the kernel's limit)
  int max_clients = 64;     ///< of both sockets; one more gets an `error` record and is closed
  /// Bound of each client's queue of records not yet taken by the kernel; what does not fit is
  /// counted and told in one `gap` record. A single longer record is sent if the queue is empty.
  std::size_t client_queue_bytes = 256 * 1024;
  std::size_t max_line_bytes = 64 * 1024;  ///< longest request of a client
  /// A client whose queue is full and who has read nothing for this long is disconnected.
  std::chrono::milliseconds stalled_client{30'000};
  int max_client_errors = 16;  ///< bad requests until a client is disconnected
  /// The same records on a SOCK_SEQPACKET socket, one a packet; empty: none. See seqpacket_path().
  std::string seqpacket_path{};
  /// Bounds of what is kept for clients that come again with `since`; 0: nothing.
  std::size_t history_bytes = 1024 * 1024;
  std::size_t history_records = 4096;
  /// File that remembers over a restart how far the epochs went (EpochLedger); empty: none. Only
  /// opened once the sockets are ours, so it may lie beside them.
  std::string ledger_path{};
};

/// Tells any number of local processes what the detector found: newline-delimited JSON on a Unix
/// stream socket, and the same a record a packet (docs/protocol.md). Nothing here blocks: a client
/// that is slow or hostile costs neither the publisher nor another client anything.
/// Thread: bound to the thread that runs the sd-event loop.
class EventServer {
 public:
  /// Starts to listen on the paths of `options` (file mode 0666) as part of `loop`, which is
  /// referenced until destruction. Sockets for these paths among `inherited` are taken over, others
  /// are made; the file of a daemon that is gone is replaced. Errors: path too long, its folder
  /// missing, something else than a socket there, a live daemon, an inherited socket that does not
  /// fit.
  static Result<std::unique_ptr<EventServer>> listen(sd_event* loop, const ServerOptions& options,
                                                     const Identity& identity,
                                                     InheritedSockets* inherited = nullptr);
  /// Closes every client and removes the socket files if they are still those made by listen().
  ~EventServer();
  EventServer(const EventServer&) = delete;
  EventServer& operator=(const EventServer&) = delete;

  /// What did not work and does not matter enough to end for it: one sentence, for the log; empty
  /// if nothing.
  const std::string& warning() const;

  /// Publishes `report` as a `loop` or `candidate` record; most reports become none (no seq is
  /// spent). Cost: one serialisation, and one non-blocking send per watching client.
  void publish(const Report& report, const Latency& latency = {});
  /// Publishes a change of state and keeps it for clients that come later.
  void publish_state(const StateRecord& record);
  /// Publishes counters, with the server's own added, and keeps them for clients that come later.
  void publish_stats(const StatsRecord& record);

  /// The map was emptied: image ids begin anew, and seq goes on. Every client gets a `hello` with
  /// the new epoch, after all that was published before, and goes on watching. The history forgets
  /// the old epoch. Call it before the record of State::kMapReset, which is then the first of the
  /// new epoch.
  void new_epoch(const std::string& epoch);

  std::size_t clients() const;           ///< connected now
  std::uint64_t newest_seq() const;      ///< of the newest published record; 0 before the first
  std::uint64_t missed_records() const;  ///< not given to slow clients so far, all clients summed
  /// Bytes queued for clients that the kernel has not taken yet, 1 at least for one that still
  /// waits for records of the history. At the end of a recording the daemon may run its loop until
  /// this is 0 (with a deadline) so that readers get everything.
  std::size_t queued_bytes() const;

 private:
  class Impl;
  explicit EventServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace loopd
