#include "events/control_server.h"

#include <sys/socket.h>

#include <utility>

#include "events/connections.h"
#include "events/passed_fds.h"

namespace loopd {

namespace {

/// A connection, who is behind it, and the descriptors it has passed.
class Controller : public Connection {
 public:
  Controller(UniqueFd socket, const ConnectionLimits& limits)
      : Connection(std::move(socket), Framing::kLines, limits) {
    socklen_t bytes = sizeof(peer);
    if (getsockopt(fd(), SOL_SOCKET, SO_PEERCRED, &peer, &bytes) != 0) peer = {};
  }

  PassedFds passed;
  ucred peer{};
  bool awaits_news = false;  ///< it has begun what is answered again later

 protected:
  ssize_t read_some(std::span<char> into, bool& cut_off) override {
    return passed.receive(fd(), into, cut_off);
  }
};

Controller& controller(Connection& client) { return static_cast<Controller&>(client); }

ConnectionLimits limits_of(const ControlOptions& options) {
  return {options.max_clients, options.client_queue_bytes, options.max_line_bytes,
          options.stalled_client, options.max_client_errors};
}

}  // namespace

class ControlServer::Impl : private ConnectionHandler {
 public:
  Impl(sd_event* loop, const ControlOptions& options, ControlActions actions)
      : limits_(limits_of(options)),
        actions_(std::move(actions)),
        connections_(loop, limits_, *this) {}

  Status start(const ControlOptions& options, InheritedSockets* inherited);
  bool send(ClientId id, std::string_view record_class, const ControlFields& fields);
  const std::vector<std::unique_ptr<Connection>>& clients() const { return connections_.all(); }

 private:
  std::unique_ptr<Connection> make_connection(UniqueFd fd, Framing) override {
    return std::make_unique<Controller>(std::move(fd), limits_);
  }
  void handle(Connection& client, const std::string& request) override;
  void all_answered(Connection& client) override;
  bool may_be_told_more(const Connection& client) const override {
    return static_cast<const Controller&>(client).awaits_news;
  }
  void gone(const Connection& client) override { actions_.gone(client.id); }
  RecordText error_line(const std::string& message, std::string_view op) const override {
    return shared_line(control_error_text(op, message));
  }
  // Nothing is published here, so nothing can be lost.
  RecordText gap_line(const Gap& gap) const override { return shared_line(gap_text(gap, {})); }
  RecordText too_large_line(std::uint64_t seq) override { return gap_line({1, seq, seq}); }

  ControlReply carry_out(Controller& client, const ParsedControl& parsed);

  const ConnectionLimits limits_;
  const ControlActions actions_;
  Connections connections_;
};

Status ControlServer::Impl::start(const ControlOptions& options, InheritedSockets* inherited) {
  if (Status started = connections_.start(); !started) return started;
  Result<ListeningSocket> socket =
      ListeningSocket::open(options.socket_path, options.mode, SOCK_STREAM, inherited);
  if (!socket) return socket.error();
  return connections_.listen(std::move(socket).value(), Framing::kLines);
}

void ControlServer::Impl::handle(Connection& connection, const std::string& request) {
  Controller& client = controller(connection);
  const ParsedControl parsed = parse_control(request);
  if (!parsed.op) {
    client.passed.clear();
    return connections_.complain(client, parsed.error, parsed.name);
  }
  const bool awaited_before = client.awaits_news;
  if (*parsed.op == ControlOp::kRecord) client.awaits_news = true;
  const ControlReply reply = carry_out(client, parsed);
  if (!reply.error.empty()) client.awaits_news = awaited_before;
  client.push(shared_line(reply.error.empty() ? control_text("ok", parsed.name, reply.fields)
                                              : control_error_text(parsed.name, reply.error)));
}

ControlReply ControlServer::Impl::carry_out(Controller& client, const ParsedControl& parsed) {
  ControlRequest request{*parsed.op, parsed.limits,   UniqueFd(),
                         client.id,  client.peer.pid, client.peer.uid};
  if (request.op == ControlOp::kRecord) {
    Result<UniqueFd> file = client.passed.take();
    if (!file) return ControlReply::refusal(file.error().message);
    if (Status fits = check_recording_file(file.value()); !fits) {
      return ControlReply::refusal(fits.error().message);
    }
    request.file = std::move(file).value();
  }
  return actions_.handle(std::move(request));
}

/// A descriptor belongs to a request that came with it. Without one, or a part of one, it belongs
/// to none.
void ControlServer::Impl::all_answered(Connection& client) {
  if (!client.has_partial_request()) controller(client).passed.clear();
}

bool ControlServer::Impl::send(ClientId id, std::string_view record_class,
                               const ControlFields& fields) {
  Connection* client = connections_.find(id);
  if (client == nullptr || client->gone()) return false;
  client->push(shared_line(control_text(record_class, {}, fields)));
  client->flush(*this);
  controller(*client).awaits_news = false;
  connections_.settle();
  return true;
}

// ------------------------------------------------------------------------------ ControlServer

Result<std::unique_ptr<ControlServer>> ControlServer::listen(sd_event* loop,
                                                             const ControlOptions& options,
                                                             ControlActions actions,
                                                             InheritedSockets* inherited) {
  auto impl = std::make_unique<Impl>(loop, options, std::move(actions));
  if (Status status = impl->start(options, inherited); !status) return status.error();
  return std::unique_ptr<ControlServer>(new ControlServer(std::move(impl)));
}

ControlServer::ControlServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ControlServer::~ControlServer() = default;

bool ControlServer::send(std::uint64_t client, std::string_view record_class,
                         const ControlFields& fields) {
  return impl_->send(client, record_class, fields);
}

std::size_t ControlServer::clients() const { return impl_->clients().size(); }

std::size_t ControlServer::queued_bytes() const {
  std::size_t bytes = 0;
  for (const auto& client : impl_->clients()) bytes += client->queue().bytes();
  return bytes;
}

}  // namespace loopd
