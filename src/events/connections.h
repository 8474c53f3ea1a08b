#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "events/acceptor.h"
#include "events/connection.h"
#include "events/listening_socket.h"
#include "events/sd_event_handles.h"

namespace loopd {

/// What a server makes of its clients. Called by Connections, in the thread of the loop.
class ConnectionHandler : public LossTeller {
 public:
  /// The connection object for a client that has just come.
  virtual std::unique_ptr<Connection> make_connection(UniqueFd fd, Framing framing) = 0;
  /// Queues what the client is told at once.
  virtual void greet(Connection&) {}
  /// Answers one request: text without its newline, never empty, any bytes.
  virtual void handle(Connection& client, const std::string& request) = 0;
  /// All that the client has sent so far is answered.
  virtual void all_answered(Connection&) {}
  /// Gives the client's queue what waits for room in it; flushes as it goes.
  virtual void refill(Connection&) {}
  /// Whether a client that will ask nothing more may still have something to hear.
  virtual bool may_be_told_more(const Connection& client) const = 0;
  /// The client is no longer among Connections::all().
  virtual void gone(const Connection&) {}
  /// The text for a mistake in a request of kind `op` (empty if that is not known).
  virtual RecordText error_line(const std::string& message, std::string_view op) const = 0;
};

/// The clients of one server: accepts them, cuts requests, sends what is queued, and turns away,
/// disconnects or forgets those who are too many, too slow, too wrong or gone.
/// Thread: that of the loop.
class Connections {
 public:
  Connections(sd_event* loop, const ConnectionLimits& limits, ConnectionHandler& handler);

  Status start();
  /// Serves those who connect to `socket`, too.
  Status listen(ListeningSocket socket, Framing framing);

  const std::vector<std::unique_ptr<Connection>>& all() const { return clients_; }
  Connection* find(ClientId id) const;

  /// Tells the client its mistake; one mistake too many ends the connection.
  void complain(Connection& client, const std::string& message, std::string_view op = {});
  /// To be called after records were given to clients outside of the handler's functions. Ends the
  /// clients that are gone, unless one is being served: then that is done afterwards.
  void settle();

 private:
  class Serving;
  static int on_client(sd_event_source*, int fd, std::uint32_t events, void* self);
  static int on_stall_timer(sd_event_source*, std::uint64_t now_us, void* self);

  void welcome(UniqueFd fd, Framing framing);
  void turn_away(const UniqueFd& fd, Framing framing) const;
  void serve(Connection& client, std::uint32_t events);
  void answer_requests(Connection& client);
  void end_of_input(Connection& client);
  void sweep();
  void update_interest(Connection& client) const;
  void arm_stall_timer();
  Connection::Clock::time_point deadline(const Connection& client) const {
    return client.last_progress() + limits_.stalled_client;
  }

  const LoopReference loop_;
  const ConnectionLimits limits_;
  ConnectionHandler& handler_;
  std::vector<char> scratch_;  ///< what one read may bring
  ClientId last_id_ = 0;
  int serving_ = 0;  ///< calls on the stack that hold a client: nothing may be removed
  std::vector<std::unique_ptr<Connection>> clients_;
  EventSource stall_timer_;
  std::vector<std::unique_ptr<Acceptor>> acceptors_;
};

}  // namespace loopd
