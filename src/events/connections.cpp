#include "events/connections.h"

#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <utility>

namespace loopd {

namespace {

/// One wake-up reads this much of one client, so that a flood of one leaves time for the others;
/// only a packet, which must be read at once, may be longer.
constexpr std::size_t kReadBytes = 16 * 1024;

std::string too_long_text(Framing framing, std::size_t max_bytes) {
  const bool packet = framing == Framing::kPackets;
  return (packet ? "packet longer than " : "line longer than ") + std::to_string(max_bytes) +
         (packet ? " bytes: thrown away" : " bytes: thrown away up to its newline");
}

}  // namespace

/// While one lives, clients are not removed; the last one does so.
class Connections::Serving {
 public:
  explicit Serving(Connections& connections) : connections_(connections) {
    ++connections_.serving_;
  }
  ~Serving() {
    --connections_.serving_;
    connections_.settle();
  }
  Serving(const Serving&) = delete;
  Serving& operator=(const Serving&) = delete;

 private:
  Connections& connections_;
};

Connections::Connections(sd_event* loop, const ConnectionLimits& limits, ConnectionHandler& handler)
    : loop_(sd_event_ref(loop)),
      limits_(limits),
      handler_(handler),
      scratch_(std::max(kReadBytes, limits.max_request_bytes + 2)) {}

Status Connections::start() {
  auto timer = make_timer(loop_.get(), on_stall_timer, this, "slow clients");
  if (!timer) return timer.error();
  stall_timer_ = std::move(timer).value();
  return Nothing();
}

Status Connections::listen(ListeningSocket socket, Framing framing) {
  auto acceptor = Acceptor::start(
      loop_.get(), std::move(socket), limits_.max_clients + 1,
      {[this, framing](UniqueFd fd) { welcome(std::move(fd), framing); }, [this] { settle(); }});
  if (!acceptor) return acceptor.error();
  acceptors_.push_back(std::move(acceptor).value());
  return Nothing();
}

Connection* Connections::find(ClientId id) const {
  const auto it = std::find_if(clients_.begin(), clients_.end(),
                               [id](const auto& client) { return client->id == id; });
  return it == clients_.end() ? nullptr : it->get();
}

void Connections::welcome(UniqueFd fd, Framing framing) {
  if (clients_.size() >= static_cast<std::size_t>(limits_.max_clients)) {
    return turn_away(fd, framing);
  }
  auto client = handler_.make_connection(std::move(fd), framing);
  auto source = watch_fd(loop_.get(), client->fd(), EPOLLIN, on_client, this, "a client");
  if (!source) return;  // out of memory or epoll watches: the connection closes
  client->set_source(std::move(source).value());
  client->id = ++last_id_;
  handler_.greet(*client);
  client->flush(handler_);
  clients_.push_back(std::move(client));
}

void Connections::turn_away(const UniqueFd& fd, Framing framing) const {
  const RecordText line = handler_.error_line(
      "too many clients: " + std::to_string(limits_.max_clients) + " are connected", {});
  const std::size_t bytes = line->size() - (framing == Framing::kPackets ? 1 : 0);
  (void)send(fd.get(), line->data(), bytes, MSG_NOSIGNAL | MSG_DONTWAIT);
}

// ----------------------------------------------------------------------------- what clients send

int Connections::on_client(sd_event_source*, int fd, std::uint32_t events, void* self) {
  Connections& connections = *static_cast<Connections*>(self);
  const auto& clients = connections.clients_;
  const auto it = std::find_if(clients.begin(), clients.end(),
                               [fd](const auto& client) { return client->fd() == fd; });
  if (it != clients.end()) connections.serve(**it, events);
  return 0;
}

void Connections::serve(Connection& client, std::uint32_t events) {
  const Serving serving(*this);
  if ((events & EPOLLERR) != 0) return client.end();
  if ((events & EPOLLIN) != 0) client.receive(scratch_);
  answer_requests(client);
  // Who asks and leaves at once is still heard.
  if ((events & EPOLLHUP) != 0) return client.end();
  client.flush(handler_);
  handler_.refill(client);
  answer_requests(client);  // what had to wait while the queue was full
  if (client.input_closed()) end_of_input(client);
}

void Connections::answer_requests(Connection& client) {
  std::string text;
  while (!client.gone() && !client.must_read()) {
    switch (client.next_request(text)) {
      case Connection::Request::kNone:
        handler_.all_answered(client);
        return;
      case Connection::Request::kText:
        if (text.ends_with('\r')) text.pop_back();
        if (!text.empty()) handler_.handle(client, text);
        break;
      case Connection::Request::kTooLong:
        complain(client, too_long_text(client.framing(), limits_.max_request_bytes));
        break;
    }
  }
}

/// Called whenever one that asks nothing more was served.
void Connections::end_of_input(Connection& client) {
  if (client.must_read()) return;  // requests may still wait to be answered
  if (client.drop_partial_request()) complain(client, "the last line has no newline: not read");
  client.flush(handler_);
  // With nothing to be told and nothing more to ask, this connection has no use.
  if (client.queue().empty() && !handler_.may_be_told_more(client)) client.end();
}

void Connections::complain(Connection& client, const std::string& message, std::string_view op) {
  ++client.errors;
  const bool last = client.errors >= limits_.max_errors;
  const std::string end = last ? "; too many errors, disconnecting" : "";
  client.push(handler_.error_line(message + end, op));
  if (!last) return;
  client.flush(handler_);
  client.end();
}

// -------------------------------------------------------------------------------- upkeep

/// Every path that touched a client ends here.
void Connections::settle() {
  if (serving_ > 0) return;
  for (const auto& client : clients_) update_interest(*client);
  sweep();
  arm_stall_timer();
}

void Connections::sweep() {
  std::vector<std::unique_ptr<Connection>> leaving;
  for (auto& client : clients_) {
    if (client->gone()) leaving.push_back(std::move(client));
  }
  std::erase(clients_, nullptr);
  for (const auto& client : leaving) handler_.gone(*client);
}

/// A client that must read first is not read from either: its answers would have no room.
void Connections::update_interest(Connection& client) const {
  const bool read = !client.input_closed() && !client.must_read();
  const bool write = !client.queue().empty() || client.backlog;
  const std::uint32_t events = (read ? static_cast<std::uint32_t>(EPOLLIN) : 0u) |
                               (write ? static_cast<std::uint32_t>(EPOLLOUT) : 0u);
  if (!client.gone() && sd_event_source_set_io_events(client.source().get(), events) < 0) {
    client.end();
  }
}

void Connections::arm_stall_timer() {
  using Clock = Connection::Clock;
  auto earliest = Clock::time_point::max();
  for (const auto& client : clients_) {
    if (client->must_read()) earliest = std::min(earliest, deadline(*client));
  }
  if (earliest == Clock::time_point::max()) {
    sd_event_source_set_enabled(stall_timer_.get(), SD_EVENT_OFF);
    return;
  }
  const auto wait = std::chrono::ceil<std::chrono::microseconds>(earliest - Clock::now());
  start_timer(stall_timer_, static_cast<std::uint64_t>(std::max<std::int64_t>(wait.count(), 0)));
}

int Connections::on_stall_timer(sd_event_source*, std::uint64_t, void* self) {
  Connections& connections = *static_cast<Connections*>(self);
  const auto now = Connection::Clock::now();
  for (const auto& client : connections.clients_) {
    if (client->must_read() && connections.deadline(*client) <= now) client->end();
  }
  connections.settle();
  return 0;
}

}  // namespace loopd
