#include "loopctl/session.h"

#include <algorithm>
#include <iostream>

#include "events/client.h"
#include "loopctl/render.h"
#include "loopctl/stop_signals.h"

namespace loopd::loopctl {

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

/// Long enough not to matter, short enough to add to a time point.
constexpr milliseconds kForever = std::chrono::hours(24 * 365);
/// Between attempts to connect: a restarted daemon is found again well within a second.
constexpr milliseconds kRetry{250};

void complain(const std::string& message) { std::cerr << "loopctl: " << message << std::endl; }

std::string class_of(const Json& record) { return text_of(record, "class"); }

/// One run of `loopctl watch`, over as many connections as it takes.
class Watch {
 public:
  explicit Watch(const WatchOptions& options)
      : options_(options), deadline_(Clock::now() + options.timeout.value_or(kForever)) {}

  int run() {
    while (!done_) {
      const Error end = one_connection();
      if (done_) break;
      if (ended_in_order_ && !options_.retry) return finish();
      report_end(end);
      if (!options_.retry) return 1;
      if (signals_.take(std::min(kRetry, left()))) return 0;
      done_ = left() == milliseconds(0);
    }
    return finish();
  }

 private:
  milliseconds left() const {
    const auto left = std::chrono::ceil<milliseconds>(deadline_ - Clock::now());
    return std::max(left, milliseconds(0));
  }

  /// Returns why there is nothing more to read; done_ tells if there need not be.
  Error one_connection() {
    Result<EventClient> client = EventClient::connect(options_.socket_path);
    if (!client) return client.error();
    WatchRequest request = options_.request;
    request.since = since_;
    if (Status sent = client->watch(request); !sent) return sent.error();
    last_complaint_.clear();
    ended_in_order_ = false;
    while (!done_) {
      Result<std::optional<std::string>> text = client->next(left(), signals_.fd());
      if (!text) return text.error();
      if (text.value()) {
        show(*text.value());
      } else {
        stopped_ = signals_.take();
        done_ = stopped_ || left() == milliseconds(0);
      }
    }
    return {};
  }

  void show(const std::string& text) {
    const Json record = parse_json(text);
    const std::string line = options_.json || record.is_discarded() ? text : record_line(record);
    if (options_.json) {
      std::cout << line << std::endl;
    } else if (!line.empty()) {
      std::cout << time_of_day() << ' ' << line << std::endl;
    }
    if (!std::cout) done_ = stopped_ = true;  // nobody reads any more
    account(record);
  }

  void account(const Json& record) {
    const std::string record_class = class_of(record);
    remember_position(record, record_class);
    if (record_class == "state") {
      ended_in_order_ = text_of(record, "state") == state_name(State::kShuttingDown);
    }
    if (record_class != "loop") return;
    ++loops_;
    if (options_.count && loops_ >= *options_.count) done_ = true;
  }

  /// Where to go on after a connection that breaks: after the newest record that was watched, and
  /// before the first of them where the daemon stood when it was asked.
  void remember_position(const Json& record, const std::string& record_class) {
    const Json& seq = member(record, "seq");
    if (!seq.is_number_unsigned()) return;
    const auto watched = record_class_from_name(record_class);
    const bool seen =
        watched && options_.request.classes.has(*watched) && member(record, "repeat") != true;
    if (!seen && (record_class != "watch" || since_)) return;
    since_ = Since{text_of(record, "epoch"), seq.get<std::uint64_t>()};
  }

  /// Says why, once for each reason: with --retry the same one comes four times a second.
  void report_end(const Error& end) {
    if (end.message == last_complaint_) return;
    last_complaint_ = end.message;
    complain(end.message + (options_.retry ? "; trying again" : ""));
  }

  int finish() const {
    if (stopped_ || !options_.count || loops_ >= *options_.count) return 0;
    complain("only " + std::to_string(loops_) + " of " + std::to_string(*options_.count) +
             " loops came");
    return 1;
  }

  const WatchOptions& options_;
  const StopSignals signals_;
  const Clock::time_point deadline_;
  bool done_ = false;
  bool stopped_ = false;         ///< by a signal: what was asked for is what came
  bool ended_in_order_ = false;  ///< the daemon has said that it shuts down
  std::uint64_t loops_ = 0;
  std::optional<Since> since_;
  std::string last_complaint_;
};

}  // namespace

Result<Snapshot> ask_status(const std::string& socket_path, milliseconds timeout) {
  Result<EventClient> client = EventClient::connect(socket_path);
  if (!client) return client.error();
  // Nothing is asked for last: the answer to that tells that all there was has come.
  const WatchRequest newest{{RecordClass::kState, RecordClass::kStats}, false, std::nullopt};
  const WatchRequest nothing{{}, false, std::nullopt};
  for (const WatchRequest& request : {newest, nothing}) {
    if (Status sent = client->watch(request); !sent) return sent.error();
  }
  Snapshot snapshot;
  const auto deadline = Clock::now() + timeout;
  for (int answers = 0; answers < 2;) {
    const auto left = std::chrono::ceil<milliseconds>(deadline - Clock::now());
    Result<std::optional<std::string>> text = client->next(std::max(left, milliseconds(0)));
    if (!text) return text.error();
    if (!text.value()) {
      return Error{"loopd at \"" + socket_path + "\" accepts connections but does not answer",
                   ETIMEDOUT};
    }
    Json record = parse_json(*text.value());
    const std::string record_class = class_of(record);
    if (record_class == "error") return Error{"loopd says: " + record_line(record), 0};
    if (record_class == "watch") ++answers;
    if (record_class == "hello") snapshot.hello = std::move(record);
    if (record_class == "state") snapshot.state = std::move(record);
    if (record_class == "stats") snapshot.stats = std::move(record);
  }
  return snapshot;
}

int watch(const WatchOptions& options) { return Watch(options).run(); }

int status(const StatusOptions& options) {
  const Result<Snapshot> snapshot = ask_status(options.socket_path, options.timeout);
  if (!snapshot) {
    complain(snapshot.error().message);
    return 1;
  }
  const auto& [hello, state, stats] = snapshot.value();
  if (options.json) {
    const Json json{{"hello", hello}, {"state", state}, {"stats", stats}};
    std::cout << dump(json) << std::endl;
  } else {
    std::cout << status_block(hello, state, stats, options.socket_path) << std::flush;
  }
  return std::cout ? 0 : 1;
}

}  // namespace loopd::loopctl
