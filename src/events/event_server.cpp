#include "events/event_server.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "events/connections.h"
#include "events/epoch_ledger.h"
#include "events/history.h"
#include "events/resume.h"

namespace loopd {

namespace {

/// Anyone on the robot may connect (that needs write permission): events only tell, no request on
/// this socket changes anything. Who must not listen is kept out by the folder's mode.
constexpr mode_t kSocketMode = 0666;

/// A record in the forms clients may ask for; the second is only made if someone did.
struct PublishedRecord {
  RecordClass record_class;
  RecordText text;
  RecordText text_with_pairs;
};

/// A connection and what it watches.
struct Watcher : Connection {
  using Connection::Connection;

  WatchRequest watch{ClassSet(), false, std::nullopt};  ///< nothing until it asks
  /// While it is sent records of the history: the seq that comes next. None: live.
  std::optional<std::uint64_t> replay;
};

Watcher& watcher(Connection& client) { return static_cast<Watcher&>(client); }

ConnectionLimits limits_of(const ServerOptions& options) {
  return {options.max_clients, options.client_queue_bytes, options.max_line_bytes,
          options.stalled_client, options.max_client_errors};
}

}  // namespace

class EventServer::Impl : private ConnectionHandler {
 public:
  Impl(sd_event* loop, const ServerOptions& options, const Identity& identity)
      : options_(options),
        identity_(identity),
        history_(options.history_bytes, options.history_records),
        connections_(loop, limits_of(options), *this) {}

  Status start(InheritedSockets* inherited);
  void publish(const Report& report, const Latency& latency);
  void publish_state(const StateRecord& record);
  void publish_stats(const StatsRecord& record);
  void new_epoch(const std::string& epoch);
  const std::string& warning() const { return warning_; }
  std::size_t clients() const { return connections_.all().size(); }
  std::uint64_t newest_seq() const { return seq_; }
  std::uint64_t missed_records() const { return missed_records_; }
  std::size_t queued_bytes() const;

 private:
  /// Newest record of a class that new watchers are told at once.
  template <class Record>
  struct Kept {
    Record record;
    std::string epoch;
    std::uint64_t seq = 0;
    ServerStats server{};  ///< as published with it

    StreamPosition position() const { return {epoch, seq}; }
  };

  std::unique_ptr<Connection> make_connection(UniqueFd fd, Framing framing) override {
    return std::make_unique<Watcher>(std::move(fd), framing, limits_of(options_));
  }
  void greet(Connection& client) override;
  void handle(Connection& client, const std::string& request) override;
  void refill(Connection& client) override;
  bool may_be_told_more(const Connection& client) const override {
    return !static_cast<const Watcher&>(client).watch.classes.empty();
  }
  RecordText error_line(const std::string& message, std::string_view op) const override;
  RecordText gap_line(const Gap& gap) const override;
  RecordText too_large_line(std::uint64_t seq) override;

  Status listen(const std::string& path, int type, Framing framing, InheritedSockets* inherited);
  void answer_watch(Watcher& client, const WatchRequest& request);
  void repeat_newest(Watcher& client);
  void replay_some(Watcher& client);
  void tell_losses_of_replay(Watcher& client, std::uint64_t until);
  void end_epoch_for(Watcher& client);
  void begin_record(RecordClass record_class);
  void distribute(const PublishedRecord& record);

  StreamPosition position() const { return {identity_.epoch, seq_}; }
  ClientPolicy policy() const {
    return {options_.client_queue_bytes, options_.max_line_bytes, options_.stalled_client.count(),
            options_.history_bytes};
  }

  const ServerOptions options_;
  Identity identity_;
  std::string warning_;
  std::uint64_t seq_ = 0;
  std::uint64_t missed_records_ = 0;
  EpochLedger ledger_;
  History history_;
  std::optional<Kept<StateRecord>> state_;
  std::optional<Kept<StatsRecord>> stats_;
  Connections connections_;  ///< last: its clients are gone before what serves them
};

// ------------------------------------------------------------------------------- start

Status EventServer::Impl::start(InheritedSockets* inherited) {
  Status status = connections_.start();
  if (status) status = listen(options_.socket_path, SOCK_STREAM, Framing::kLines, inherited);
  if (status && !options_.seqpacket_path.empty()) {
    status = listen(options_.seqpacket_path, SOCK_SEQPACKET, Framing::kPackets, inherited);
  }
  if (!status) return status;
  if (!options_.ledger_path.empty()) {
    EpochLedger::Opened opened = EpochLedger::open(options_.ledger_path);
    warning_ = std::move(opened.warning);
    ledger_ = std::move(opened.ledger);
  }
  ledger_.begin_epoch(identity_.epoch, seq_ + 1);
  return Nothing();
}

Status EventServer::Impl::listen(const std::string& path, int type, Framing framing,
                                 InheritedSockets* inherited) {
  Result<ListeningSocket> socket = ListeningSocket::open(path, kSocketMode, type, inherited);
  if (!socket) return socket.error();
  return connections_.listen(std::move(socket).value(), framing);
}

// ----------------------------------------------------------------------------- what clients ask

void EventServer::Impl::greet(Connection& client) {
  client.push(shared_line(hello_text(identity_, position())));
}

void EventServer::Impl::handle(Connection& client, const std::string& request) {
  const ParsedRequest parsed = parse_request(request);
  if (parsed.watch) {
    answer_watch(watcher(client), *parsed.watch);
  } else {
    connections_.complain(client, parsed.error);
  }
}

/// No replay is under way: requests wait for its end.
void EventServer::Impl::answer_watch(Watcher& client, const WatchRequest& request) {
  client.watch = request;
  ResumePlan plan{{}, {}, seq_ + 1};
  if (request.since) {
    plan = plan_resume(*request.since, request.classes, identity_.epoch, ledger_, history_);
  }
  client.push(shared_line(watch_text(request, policy(), position(), plan.answer)));
  client.replay = plan.from <= seq_ ? std::optional(plan.from) : std::nullopt;
  repeat_newest(client);
  for (const Loss& loss : plan.gaps) client.push(shared_line(gap_text(loss, position())));
  refill(client);
}

/// Not those that come by themselves: they are still in the history the client is being sent.
void EventServer::Impl::repeat_newest(Watcher& client) {
  const std::uint64_t known_before =
      client.replay ? std::max(*client.replay, history_.oldest()) : seq_ + 1;
  if (state_ && client.watch.classes.has(RecordClass::kState) && state_->seq < known_before) {
    client.push(shared_line(state_text(state_->record, state_->position(), true)), state_->seq);
  }
  if (stats_ && client.watch.classes.has(RecordClass::kStats) && stats_->seq < known_before) {
    client.push(shared_line(stats_text(stats_->record, stats_->server, stats_->position(), true)),
                stats_->seq);
  }
}

RecordText EventServer::Impl::error_line(const std::string& message, std::string_view) const {
  return shared_line(error_text(message, position()));
}

RecordText EventServer::Impl::gap_line(const Gap& gap) const {
  return shared_line(gap_text(gap, position()));
}

RecordText EventServer::Impl::too_large_line(std::uint64_t seq) {
  ++missed_records_;
  return gap_line({1, seq, seq});
}

// --------------------------------------------------------------------------- the history

/// Sends of the history what there is room for. The rest waits for the next turn of the loop, and
/// with it the client's next request, so that asking for all of it again and again holds up nobody.
void EventServer::Impl::refill(Connection& connection) {
  Watcher& client = watcher(connection);
  client.flush(*this);
  if (!client.replay) return;
  replay_some(client);
  client.backlog = client.replay.has_value();
  client.flush(*this);
}

/// Moves the client on through the history as far as its queue takes it.
void EventServer::Impl::replay_some(Watcher& client) {
  if (*client.replay < history_.oldest() && client.queue().may_tell_gap()) {
    tell_losses_of_replay(client, history_.oldest());
    client.replay = history_.oldest();
  }
  while (client.replay >= history_.oldest() && *client.replay <= seq_) {
    const History::Entry& entry = history_.at(*client.replay);
    if (client.watch.classes.has(entry.record_class)) {
      if (!client.queue().has_room(entry.text->size())) break;
      client.push(entry.text, entry.seq);
    }
    ++*client.replay;
  }
  if (*client.replay > seq_) client.replay.reset();  // live from here on
}

/// The history has gone on without a client that reads it too slowly.
void EventServer::Impl::tell_losses_of_replay(Watcher& client, std::uint64_t until) {
  const auto loss = loss_in_epoch(*client.replay, until, client.watch.classes, ledger_);
  if (!loss) return;
  missed_records_ += loss->count.value_or(0);
  client.push(shared_line(gap_text(*loss, position())));
}

// --------------------------------------------------------------------------- what clients receive

void EventServer::Impl::publish(const Report& report, const Latency& latency) {
  const std::optional<RecordClass> record_class = record_class_of(report);
  if (!record_class) return;
  begin_record(*record_class);
  const auto& clients = connections_.all();
  const bool pairs = std::any_of(clients.begin(), clients.end(), [&](const auto& client) {
    const WatchRequest& watch = watcher(*client).watch;
    return watch.pairs && watch.classes.has(*record_class);
  });
  PublishedRecord record{*record_class,
                         shared_line(report_text(report, latency, position(), false)), nullptr};
  if (pairs) record.text_with_pairs = shared_line(report_text(report, latency, position(), true));
  distribute(record);
}

void EventServer::Impl::publish_state(const StateRecord& record) {
  begin_record(RecordClass::kState);
  state_ = {record, identity_.epoch, seq_, {}};
  distribute({RecordClass::kState, shared_line(state_text(record, position(), false)), nullptr});
}

void EventServer::Impl::publish_stats(const StatsRecord& record) {
  begin_record(RecordClass::kStats);
  stats_ = {record, identity_.epoch, seq_, {clients(), missed_records_}};
  distribute({RecordClass::kStats,
              shared_line(stats_text(record, stats_->server, position(), false)), nullptr});
}

/// Before any client can see the record, so that no ledger ever says less than a client knows.
void EventServer::Impl::begin_record(RecordClass record_class) {
  ++seq_;
  ledger_.add(record_class);
}

void EventServer::Impl::distribute(const PublishedRecord& record) {
  history_.add({seq_, record.record_class, record.text});
  for (const auto& connection : connections_.all()) {
    Watcher& client = watcher(*connection);
    if (client.replay) {
      refill(client);  // this record is in the history, too
    } else if (client.watch.classes.has(record.record_class)) {
      const bool with_pairs = client.watch.pairs && record.text_with_pairs != nullptr;
      if (client.offer(with_pairs ? record.text_with_pairs : record.text, seq_)) {
        client.flush(*this);
      } else {
        ++missed_records_;
      }
    }
  }
  connections_.settle();
}

void EventServer::Impl::new_epoch(const std::string& epoch) {
  for (const auto& client : connections_.all()) end_epoch_for(watcher(*client));
  history_.clear();
  identity_.epoch = epoch;
  ledger_.begin_epoch(epoch, seq_ + 1);
  for (const auto& client : connections_.all()) {
    greet(*client);
    client->flush(*this);
    // One that never reads, while the map is emptied again and again, must not pile up greetings.
    if (client->queue().bytes() > 2 * options_.client_queue_bytes) client->end();
  }
  connections_.settle();
}

/// What the client was not sent of the epoch that ends is told now, as nothing of it is kept.
void EventServer::Impl::end_epoch_for(Watcher& client) {
  refill(client);
  if (const std::optional<Gap> gap = client.take_gap()) client.push(gap_line(*gap));
  if (client.replay) tell_losses_of_replay(client, seq_ + 1);
  client.replay.reset();
  client.backlog = false;
}

std::size_t EventServer::Impl::queued_bytes() const {
  std::size_t bytes = 0;
  for (const auto& client : connections_.all()) {
    const std::size_t waiting = client->backlog ? 1 : 0;  // some, while the queue may be empty
    bytes += std::max(client->queue().bytes(), waiting);
  }
  return bytes;
}

// -------------------------------------------------------------------------------- EventServer

Result<std::unique_ptr<EventServer>> EventServer::listen(sd_event* loop,
                                                         const ServerOptions& options,
                                                         const Identity& identity,
                                                         InheritedSockets* inherited) {
  auto impl = std::make_unique<Impl>(loop, options, identity);
  if (Status status = impl->start(inherited); !status) return status.error();
  return std::unique_ptr<EventServer>(new EventServer(std::move(impl)));
}

EventServer::EventServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
EventServer::~EventServer() = default;

const std::string& EventServer::warning() const { return impl_->warning(); }
void EventServer::publish(const Report& report, const Latency& latency) {
  impl_->publish(report, latency);
}
void EventServer::publish_state(const StateRecord& record) { impl_->publish_state(record); }
void EventServer::publish_stats(const StatsRecord& record) { impl_->publish_stats(record); }
void EventServer::new_epoch(const std::string& epoch) { impl_->new_epoch(epoch); }
std::size_t EventServer::clients() const { return impl_->clients(); }
std::uint64_t EventServer::newest_seq() const { return impl_->newest_seq(); }
std::uint64_t EventServer::missed_records() const { return impl_->missed_records(); }
std::size_t EventServer::queued_bytes() const { return impl_->queued_bytes(); }

}  // namespace loopd
