#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "base/unique_fd.h"
#include "events/client_queue.h"
#include "events/line_buffer.h"
#include "events/sd_event_handles.h"

namespace loopd {

/// Tells the connections of one server apart; never used twice.
using ClientId = std::uint64_t;

/// How requests and records are cut out of the socket.
enum class Framing {
  kLines,    ///< SOCK_STREAM: each ends with a newline
  kPackets,  ///< SOCK_SEQPACKET: each is a packet; a newline at the end may be there or not
};

/// What one client may cost; the members are those of ServerOptions.
struct ConnectionLimits {
  int max_clients = 64;
  std::size_t queue_bytes = 256 * 1024;
  std::size_t max_request_bytes = 64 * 1024;
  std::chrono::milliseconds stalled_client{30'000};
  int max_errors = 16;
};

/// Makes the texts that a Connection has to put into its own stream. Thread: that of the server.
class LossTeller {
 public:
  virtual ~LossTeller() = default;
  /// Records that were refused because the queue was full.
  virtual RecordText gap_line(const Gap& gap) const = 0;
  /// The record `seq` is larger than a packet can be: sent instead of it.
  virtual RecordText too_large_line(std::uint64_t seq) = 0;
};

/// One client's socket: requests come out of it, records go into it, and nothing blocks.
/// Thread: bound to that of the server.
class Connection {
 public:
  using Clock = std::chrono::steady_clock;
  enum class Request { kNone, kText, kTooLong };

  Connection(UniqueFd fd, Framing framing, const ConnectionLimits& limits);
  virtual ~Connection() = default;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  int fd() const { return fd_.get(); }
  /// Its entry in the event loop.
  const EventSource& source() const { return source_; }
  void set_source(EventSource source) { source_ = std::move(source); }
  Framing framing() const { return framing_; }

  /// Reads once what has come, at most `scratch` of it; sets gone() or input_closed().
  void receive(std::span<char> scratch);
  /// The next complete request; kTooLong is told once for each that is longer than allowed.
  Request next_request(std::string& text);
  /// Whether a line has begun and its newline has not come.
  bool has_partial_request() const { return lines_.has_partial_line(); }
  /// Forgets such a line; whether there was one.
  bool drop_partial_request();
  bool input_closed() const { return input_closed_; }  ///< it will ask nothing more

  /// Queues an answer; see ClientQueue::push().
  void push(RecordText text, std::optional<std::uint64_t> seq = std::nullopt);
  /// Queues a published record; see ClientQueue::offer().
  bool offer(const RecordText& text, std::uint64_t seq);
  /// Gives the kernel what it takes of the queue now.
  void flush(LossTeller& losses);
  const ClientQueue& queue() const { return queue_; }
  std::optional<Gap> take_gap() { return queue_.take_gap(); }

  /// To be closed by the server's next sweep.
  bool gone() const { return gone_; }
  void end() { gone_ = true; }

  /// It has reason to read: its queue is full, or more than the queue holds is waiting.
  bool must_read() const { return queue_.full() || backlog; }
  /// When the queue was last empty, or the client last read something.
  Clock::time_point last_progress() const { return last_progress_; }

  ClientId id = 0;       ///< given by the server
  int errors = 0;        ///< requests that were mistakes
  bool backlog = false;  ///< records that it is to get wait outside of its queue

 protected:
  /// One non-blocking read, with recvmsg()'s result; a packet longer than `into` sets `cut_off`.
  virtual ssize_t read_some(std::span<char> into, bool& cut_off);

 private:
  void take_packet(std::span<const char> bytes, bool cut_off);
  ssize_t send_lines();
  ssize_t send_packet();
  bool enlarge_send_buffer(std::size_t packet_bytes);
  bool replace_unsendable(LossTeller& losses);

  const UniqueFd fd_;
  const Framing framing_;
  const std::size_t max_request_bytes_;
  LineBuffer lines_;
  std::string packet_;                       ///< kPackets: the request that waits, if any
  Request packet_request_ = Request::kNone;  ///< and whether there is one
  ClientQueue queue_;
  bool input_closed_ = false;
  bool gone_ = false;
  Clock::time_point last_progress_{};
  EventSource source_;  ///< last: unregistered before the fd closes
};

}  // namespace loopd
