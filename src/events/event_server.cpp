#include "events/event_server.h"

#include <sys/epoll.h>
#include <sys/socket.h>
#include <systemd/sd-event.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>
#include <vector>

#include "base/unique_fd.h"
#include "events/client_queue.h"
#include "events/line_buffer.h"
#include "events/listening_socket.h"

namespace loopd {

namespace {

using Clock = std::chrono::steady_clock;

/// Anyone on the robot may connect (that needs write permission): events only tell, no request on
/// this socket changes anything. Who must not listen is kept out by the folder's mode.
constexpr mode_t kSocketMode = 0666;
/// One wake-up reads this much of one client, so that a flood of one leaves time for the others.
constexpr std::size_t kReadBytes = 16 * 1024;
constexpr std::size_t kSendParts = 16;
/// A line that has brought this much without an end is a flood, not a mistake.
constexpr std::size_t kMaxDiscardedBytes = 16 * 1024 * 1024;
constexpr std::uint64_t kAcceptRetryUs = 1'000'000;
constexpr std::uint64_t kTimerAccuracyUs = 10'000;

struct SourceUnref {
  void operator()(sd_event_source* source) const { sd_event_source_disable_unref(source); }
};
using EventSource = std::unique_ptr<sd_event_source, SourceUnref>;

struct LoopUnref {
  void operator()(sd_event* loop) const { sd_event_unref(loop); }
};
using EventLoop = std::unique_ptr<sd_event, LoopUnref>;

RecordText shared_line(std::string text) {
  text += '\n';
  return std::make_shared<const std::string>(std::move(text));
}

/// A record in the forms clients may ask for; the second is only made if someone did.
struct PublishedRecord {
  RecordClass record_class;
  std::uint64_t seq;
  RecordText text;
  RecordText text_with_pairs;
};

/// One connection.
struct Client {
  Client(UniqueFd socket, const ServerOptions& options)
      : fd(std::move(socket)), lines(options.max_line_bytes), queue(options.client_queue_bytes) {}

  UniqueFd fd;
  LineBuffer lines;
  ClientQueue queue;
  WatchRequest watch{ClassSet(), false, std::nullopt};  ///< nothing until it asks
  int errors = 0;
  bool input_closed = false;          ///< it will ask nothing more, but may still listen
  bool gone = false;                  ///< to be removed by the next sweep
  Clock::time_point last_progress{};  ///< the queue was empty, or the client read something
  EventSource source;                 ///< last: unregistered before the fd closes
};

}  // namespace

class EventServer::Impl {
 public:
  Impl(sd_event* loop, const ServerOptions& options, const Identity& identity,
       ListeningSocket socket)
      : options_(options),
        identity_(identity),
        loop_(sd_event_ref(loop)),
        socket_(std::move(socket)) {}

  Status start();
  void publish(const Report& report, const Latency& latency);
  void publish_state(const StateRecord& record);
  void publish_stats(const StatsRecord& record);
  std::size_t clients() const { return clients_.size(); }
  std::uint64_t newest_seq() const { return seq_; }
  std::uint64_t missed_records() const { return missed_records_; }
  std::size_t queued_bytes() const;

 private:
  static int on_accept(sd_event_source*, int fd, std::uint32_t events, void* self);
  static int on_accept_retry(sd_event_source*, std::uint64_t now_us, void* self);
  static int on_stall_timer(sd_event_source*, std::uint64_t now_us, void* self);
  static int on_client(sd_event_source* source, int fd, std::uint32_t events, void* self);

  Status add_timer(EventSource& source, sd_event_time_handler_t handler);
  void pause_accepting();
  void accept_clients();
  void welcome(UniqueFd fd);
  void turn_away(const UniqueFd& fd);
  Client* client_of(int fd);

  void serve(Client& client, std::uint32_t events);
  void receive(Client& client);
  void answer_lines(Client& client);
  void answer(Client& client, const std::string& line);
  void answer_watch(Client& client, const WatchRequest& request);
  void end_of_input(Client& client);
  void complain(Client& client, const std::string& message);

  void distribute(const PublishedRecord& record);
  void push(Client& client, RecordText text);
  void flush(Client& client);
  void update_interest(Client& client);
  void after_changes();
  void arm_stall_timer();
  Clock::time_point deadline(const Client& client) const {
    return client.last_progress + options_.stalled_client;
  }

  StreamPosition position() const { return {identity_.epoch, seq_}; }
  ClientPolicy policy() const {
    return {options_.client_queue_bytes, options_.max_line_bytes, options_.stalled_client.count()};
  }

  /// Newest record of a class that new watchers are told at once.
  template <class Record>
  struct Kept {
    Record record;
    std::uint64_t seq = 0;
  };

  const ServerOptions options_;
  const Identity identity_;
  const EventLoop loop_;
  const ListeningSocket socket_;
  std::uint64_t seq_ = 0;
  std::uint64_t missed_records_ = 0;
  std::optional<Kept<StateRecord>> state_;
  std::optional<Kept<StatsRecord>> stats_;
  ServerStats stats_server_;  ///< as published with stats_
  std::vector<std::unique_ptr<Client>> clients_;
  EventSource accept_source_;
  EventSource accept_retry_;
  EventSource stall_timer_;
};

// ------------------------------------------------------------------------------- start, accept

Status EventServer::Impl::start() {
  sd_event_source* source = nullptr;
  const int r = sd_event_add_io(loop_.get(), &source, socket_.fd(), EPOLLIN, on_accept, this);
  if (r < 0) return errno_error("cannot watch the event socket", -r);
  accept_source_.reset(source);
  if (Status status = add_timer(accept_retry_, on_accept_retry); !status) return status;
  return add_timer(stall_timer_, on_stall_timer);
}

/// A timer that is off until it is armed.
Status EventServer::Impl::add_timer(EventSource& source, sd_event_time_handler_t handler) {
  sd_event_source* timer = nullptr;
  int r = sd_event_add_time_relative(loop_.get(), &timer, CLOCK_MONOTONIC, 0, kTimerAccuracyUs,
                                     handler, this);
  if (r >= 0) {
    source.reset(timer);
    r = sd_event_source_set_enabled(timer, SD_EVENT_OFF);
  }
  if (r < 0) return errno_error("cannot make a timer for the event socket", -r);
  return Nothing();
}

int EventServer::Impl::on_accept(sd_event_source*, int, std::uint32_t, void* self) {
  static_cast<Impl*>(self)->accept_clients();
  return 0;
}

void EventServer::Impl::accept_clients() {
  for (int i = 0; i <= options_.max_clients; ++i) {  // bounded: a flood must not hold the loop
    UniqueFd fd(accept4(socket_.fd(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (fd.valid()) {
      welcome(std::move(fd));
    } else if (errno != ECONNABORTED && errno != EINTR) {
      if (errno != EAGAIN) pause_accepting();
      break;
    }
  }
  after_changes();
}

/// Out of descriptors or memory: the waiting connection would wake the loop without end.
void EventServer::Impl::pause_accepting() {
  sd_event_source_set_enabled(accept_source_.get(), SD_EVENT_OFF);
  sd_event_source_set_time_relative(accept_retry_.get(), kAcceptRetryUs);
  sd_event_source_set_enabled(accept_retry_.get(), SD_EVENT_ONESHOT);
}

int EventServer::Impl::on_accept_retry(sd_event_source*, std::uint64_t, void* self) {
  sd_event_source_set_enabled(static_cast<Impl*>(self)->accept_source_.get(), SD_EVENT_ON);
  return 0;
}

void EventServer::Impl::welcome(UniqueFd fd) {
  if (clients_.size() >= static_cast<std::size_t>(options_.max_clients)) return turn_away(fd);
  auto client = std::make_unique<Client>(std::move(fd), options_);
  sd_event_source* source = nullptr;
  const int r = sd_event_add_io(loop_.get(), &source, client->fd.get(), EPOLLIN, on_client, this);
  if (r < 0) return;  // out of memory or epoll watches: the connection closes
  client->source.reset(source);
  push(*client, shared_line(hello_text(identity_, position())));
  flush(*client);
  clients_.push_back(std::move(client));
}

void EventServer::Impl::turn_away(const UniqueFd& fd) {
  const std::string text = error_text(
      "too many clients: " + std::to_string(options_.max_clients) + " are connected", position());
  const std::string line = text + "\n";
  (void)send(fd.get(), line.data(), line.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
}

// ----------------------------------------------------------------------------- what clients send

int EventServer::Impl::on_client(sd_event_source*, int fd, std::uint32_t events, void* self) {
  Impl& server = *static_cast<Impl*>(self);
  if (Client* client = server.client_of(fd)) server.serve(*client, events);
  server.after_changes();
  return 0;
}

Client* EventServer::Impl::client_of(int fd) {
  const auto it = std::find_if(clients_.begin(), clients_.end(),
                               [fd](const auto& client) { return client->fd.get() == fd; });
  return it == clients_.end() ? nullptr : it->get();
}

void EventServer::Impl::serve(Client& client, std::uint32_t events) {
  if ((events & (EPOLLHUP | EPOLLERR)) != 0) {
    client.gone = true;
    return;
  }
  if ((events & EPOLLIN) != 0) receive(client);
  answer_lines(client);
  flush(client);
  answer_lines(client);  // what had to wait while the queue was full
}

void EventServer::Impl::receive(Client& client) {
  std::array<char, kReadBytes> bytes;
  const ssize_t n = recv(client.fd.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (n > 0) {
    client.lines.append({bytes.data(), static_cast<std::size_t>(n)});
  } else if (n == 0) {
    end_of_input(client);
  } else if (errno != EAGAIN && errno != EINTR) {
    client.gone = true;
  }
}

void EventServer::Impl::end_of_input(Client& client) {
  client.input_closed = true;
  answer_lines(client);
  if (client.lines.has_partial_line()) complain(client, "the last line has no newline: not read");
  flush(client);
  // With nothing watched and nothing more to ask, this connection has no use.
  if (client.watch.classes.empty() && !client.queue.full()) client.gone = true;
}

void EventServer::Impl::answer_lines(Client& client) {
  std::string line;
  while (!client.gone && !client.queue.full()) {
    switch (client.lines.next(line)) {
      case LineBuffer::Next::kNone:
        if (client.lines.discarded_bytes() > kMaxDiscardedBytes) client.gone = true;
        return;
      case LineBuffer::Next::kLine:
        answer(client, line);
        break;
      case LineBuffer::Next::kTooLong:
        complain(client, "line longer than " + std::to_string(options_.max_line_bytes) +
                             " bytes: thrown away up to its newline");
        break;
    }
  }
}

void EventServer::Impl::answer(Client& client, const std::string& line) {
  if (line.empty() || line == "\r") return;
  const ParsedRequest request = parse_request(line);
  if (request.watch) {
    answer_watch(client, *request.watch);
  } else {
    complain(client, request.error);
  }
}

void EventServer::Impl::answer_watch(Client& client, const WatchRequest& request) {
  client.watch = request;
  push(client, shared_line(watch_text(request, policy(), position())));
  if (state_ && request.classes.has(RecordClass::kState)) {
    push(client, shared_line(state_text(state_->record, {identity_.epoch, state_->seq}, true)));
  }
  if (stats_ && request.classes.has(RecordClass::kStats)) {
    push(client, shared_line(stats_text(stats_->record, stats_server_,
                                        {identity_.epoch, stats_->seq}, true)));
  }
}

/// Tells the client its mistake; one mistake too many ends the connection.
void EventServer::Impl::complain(Client& client, const std::string& message) {
  ++client.errors;
  const bool last = client.errors >= options_.max_client_errors;
  const std::string end = last ? "; too many errors, disconnecting" : "";
  push(client, shared_line(error_text(message + end, position())));
  if (!last) return;
  flush(client);
  client.gone = true;
}

// --------------------------------------------------------------------------- what clients receive

void EventServer::Impl::publish(const Report& report, const Latency& latency) {
  const std::optional<RecordClass> record_class = record_class_of(report);
  if (!record_class) return;
  ++seq_;
  const bool pairs = std::any_of(clients_.begin(), clients_.end(), [&](const auto& client) {
    return client->watch.pairs && client->watch.classes.has(*record_class);
  });
  PublishedRecord record{*record_class, seq_,
                         shared_line(report_text(report, latency, position(), false)), nullptr};
  if (pairs) record.text_with_pairs = shared_line(report_text(report, latency, position(), true));
  distribute(record);
}

void EventServer::Impl::publish_state(const StateRecord& record) {
  ++seq_;
  state_ = {record, seq_};
  distribute(
      {RecordClass::kState, seq_, shared_line(state_text(record, position(), false)), nullptr});
}

void EventServer::Impl::publish_stats(const StatsRecord& record) {
  ++seq_;
  stats_ = {record, seq_};
  stats_server_ = {clients_.size(), missed_records_};
  distribute({RecordClass::kStats, seq_,
              shared_line(stats_text(record, stats_server_, position(), false)), nullptr});
}

void EventServer::Impl::distribute(const PublishedRecord& record) {
  for (const auto& client : clients_) {
    if (!client->watch.classes.has(record.record_class)) continue;
    const bool with_pairs = client->watch.pairs && record.text_with_pairs != nullptr;
    if (client->queue.empty()) client->last_progress = Clock::now();
    if (client->queue.offer(with_pairs ? record.text_with_pairs : record.text, record.seq)) {
      flush(*client);
    } else {
      ++missed_records_;
    }
  }
  after_changes();
}

void EventServer::Impl::push(Client& client, RecordText text) {
  if (client.queue.empty()) client.last_progress = Clock::now();
  client.queue.push(std::move(text));
}

/// Gives the kernel what it takes of the client's queue now.
void EventServer::Impl::flush(Client& client) {
  while (!client.gone && !client.queue.empty()) {
    std::array<iovec, kSendParts> parts;
    msghdr message{};
    message.msg_iov = parts.data();
    message.msg_iovlen = client.queue.gather(parts);
    const ssize_t sent = sendmsg(client.fd.get(), &message, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent < 0) {
      if (errno == EINTR) continue;
      client.gone = errno != EAGAIN;
      return;
    }
    client.last_progress = Clock::now();
    const std::optional<Gap> gap = client.queue.consume(static_cast<std::size_t>(sent));
    if (gap) client.queue.push(shared_line(gap_text(*gap, position())));
  }
}

std::size_t EventServer::Impl::queued_bytes() const {
  std::size_t bytes = 0;
  for (const auto& client : clients_) bytes += client->queue.bytes();
  return bytes;
}

// -------------------------------------------------------------------------------- upkeep

/// Every path that touched a client ends here: nothing is removed while it is in use.
void EventServer::Impl::after_changes() {
  for (const auto& client : clients_) update_interest(*client);
  std::erase_if(clients_, [](const auto& client) { return client->gone; });
  arm_stall_timer();
}

/// A client whose queue is full is not read from either: its answers would have no room.
void EventServer::Impl::update_interest(Client& client) {
  const bool read = !client.input_closed && !client.queue.full();
  const std::uint32_t events = (read ? static_cast<std::uint32_t>(EPOLLIN) : 0u) |
                               (client.queue.empty() ? 0u : static_cast<std::uint32_t>(EPOLLOUT));
  if (!client.gone && sd_event_source_set_io_events(client.source.get(), events) < 0) {
    client.gone = true;
  }
}

void EventServer::Impl::arm_stall_timer() {
  auto earliest = Clock::time_point::max();
  for (const auto& client : clients_) {
    if (client->queue.full()) earliest = std::min(earliest, deadline(*client));
  }
  if (earliest == Clock::time_point::max()) {
    sd_event_source_set_enabled(stall_timer_.get(), SD_EVENT_OFF);
    return;
  }
  const auto wait = std::chrono::ceil<std::chrono::microseconds>(earliest - Clock::now());
  const auto wait_us = static_cast<std::uint64_t>(std::max<std::int64_t>(wait.count(), 0));
  sd_event_source_set_time_relative(stall_timer_.get(), wait_us);
  sd_event_source_set_enabled(stall_timer_.get(), SD_EVENT_ONESHOT);
}

int EventServer::Impl::on_stall_timer(sd_event_source*, std::uint64_t, void* self) {
  Impl& server = *static_cast<Impl*>(self);
  const auto now = Clock::now();
  for (const auto& client : server.clients_) {
    if (client->queue.full() && server.deadline(*client) <= now) client->gone = true;
  }
  server.after_changes();
  return 0;
}

// -------------------------------------------------------------------------------- EventServer

Result<std::unique_ptr<EventServer>> EventServer::listen(sd_event* loop,
                                                         const ServerOptions& options,
                                                         const Identity& identity) {
  Result<ListeningSocket> socket = ListeningSocket::bind(options.socket_path, kSocketMode);
  if (!socket) return socket.error();
  auto impl = std::make_unique<Impl>(loop, options, identity, std::move(socket).value());
  if (Status status = impl->start(); !status) return status.error();
  return std::unique_ptr<EventServer>(new EventServer(std::move(impl)));
}

EventServer::EventServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
EventServer::~EventServer() = default;

void EventServer::publish(const Report& report, const Latency& latency) {
  impl_->publish(report, latency);
}
void EventServer::publish_state(const StateRecord& record) { impl_->publish_state(record); }
void EventServer::publish_stats(const StatsRecord& record) { impl_->publish_stats(record); }
std::size_t EventServer::clients() const { return impl_->clients(); }
std::uint64_t EventServer::newest_seq() const { return impl_->newest_seq(); }
std::uint64_t EventServer::missed_records() const { return impl_->missed_records(); }
std::size_t EventServer::queued_bytes() const { return impl_->queued_bytes(); }

}  // namespace loopd
