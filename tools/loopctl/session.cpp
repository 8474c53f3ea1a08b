#include "session.h"

#include <poll.h>
#include <sys/signalfd.h>

#include <algorithm>
#include <csignal>
#include <iostream>

#include "base/unique_fd.h"
#include "events/client.h"
#include "render.h"

namespace loopd::loopctl {

namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

/// Long enough not to matter, short enough to add to a time point.
constexpr milliseconds kForever = std::chrono::hours(24 * 365);
/// Between attempts to connect: a restarted daemon is found again well within a second.
constexpr milliseconds kRetry{250};

/// SIGINT and SIGTERM as a descriptor, so that waiting for records and for them is one wait.
UniqueFd stop_signals() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  sigprocmask(SIG_BLOCK, &set, nullptr);
  return UniqueFd(signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK));
}

/// Whether a stop signal has come, waiting for one at most `wait`.
bool stop_requested(const UniqueFd& signals, milliseconds wait) {
  pollfd fd{signals.get(), POLLIN, 0};
  return poll(&fd, 1, static_cast<int>(wait.count())) > 0;
}

void complain(const std::string& message) { std::cerr << "loopctl: " << message << std::endl; }

Json parse(const std::string& text) { return Json::parse(text, nullptr, false); }

std::string class_of(const Json& record) {
  if (!record.is_object() || !record.contains("class") || !record["class"].is_string()) return {};
  return record["class"].get<std::string>();
}

/// One run of `loopctl watch`, over as many connections as it takes.
class Watch {
 public:
  explicit Watch(const WatchOptions& options)
      : options_(options),
        signals_(stop_signals()),
        deadline_(Clock::now() + options.timeout.value_or(kForever)) {}

  int run() {
    while (!done_) {
      const Error end = one_connection();
      if (done_) break;
      if (ended_in_order_ && !options_.retry) return finish();
      report_end(end);
      if (!options_.retry) return 1;
      if (stop_requested(signals_, std::min(kRetry, left()))) return 0;
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
    if (Status sent = client->watch(options_.request); !sent) return sent.error();
    last_complaint_.clear();
    ended_in_order_ = false;
    while (!done_) {
      Result<std::optional<std::string>> text = client->next(left(), signals_.get());
      if (!text) return text.error();
      if (text.value()) {
        show(*text.value());
      } else {
        stopped_ = stop_requested(signals_, milliseconds(0));
        done_ = stopped_ || left() == milliseconds(0);
      }
    }
    return {};
  }

  void show(const std::string& text) {
    const Json record = parse(text);
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
    if (record_class == "state") {
      ended_in_order_ = record.value("state", Json()) == state_name(State::kShuttingDown);
    }
    if (record_class != "loop") return;
    ++loops_;
    if (options_.count && loops_ >= *options_.count) done_ = true;
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
  const UniqueFd signals_;
  const Clock::time_point deadline_;
  bool done_ = false;
  bool stopped_ = false;         ///< by a signal: what was asked for is what came
  bool ended_in_order_ = false;  ///< the daemon has said that it shuts down
  std::uint64_t loops_ = 0;
  std::string last_complaint_;
};

struct Snapshot {
  Json hello, state, stats;
};

/// Asks for the current state and counters, then for nothing: the second answer tells that all
/// there was has come.
Result<Snapshot> ask_status(const StatusOptions& options) {
  Result<EventClient> client = EventClient::connect(options.socket_path);
  if (!client) return client.error();
  const WatchRequest newest{{RecordClass::kState, RecordClass::kStats}, false, std::nullopt};
  const WatchRequest nothing{{}, false, std::nullopt};
  for (const WatchRequest& request : {newest, nothing}) {
    if (Status sent = client->watch(request); !sent) return sent.error();
  }
  Snapshot snapshot;
  const auto deadline = Clock::now() + options.timeout;
  for (int answers = 0; answers < 2;) {
    const auto left = std::chrono::ceil<milliseconds>(deadline - Clock::now());
    Result<std::optional<std::string>> text = client->next(std::max(left, milliseconds(0)));
    if (!text) return text.error();
    if (!text.value()) {
      return Error{
          "loopd at \"" + options.socket_path + "\" accepts connections but does not answer",
          ETIMEDOUT};
    }
    Json record = parse(*text.value());
    const std::string record_class = class_of(record);
    if (record_class == "error") return Error{"loopd says: " + record_line(record), 0};
    if (record_class == "watch") ++answers;
    if (record_class == "hello") snapshot.hello = std::move(record);
    if (record_class == "state") snapshot.state = std::move(record);
    if (record_class == "stats") snapshot.stats = std::move(record);
  }
  return snapshot;
}

}  // namespace

int watch(const WatchOptions& options) { return Watch(options).run(); }

int status(const StatusOptions& options) {
  const Result<Snapshot> snapshot = ask_status(options);
  if (!snapshot) {
    complain(snapshot.error().message);
    return 1;
  }
  const auto& [hello, state, stats] = snapshot.value();
  if (options.json) {
    const Json json{{"hello", hello}, {"state", state}, {"stats", stats}};
    std::cout << json.dump(-1, ' ', false, Json::error_handler_t::replace) << std::endl;
  } else {
    std::cout << status_block(hello, state, stats, options.socket_path) << std::flush;
  }
  return std::cout ? 0 : 1;
}

}  // namespace loopd::loopctl
