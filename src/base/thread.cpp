#include "base/thread.h"

#include <pthread.h>
#include <sched.h>
#include <signal.h>

#include <cerrno>
#include <future>
#include <optional>
#include <system_error>
#include <utility>

namespace loopd {
namespace {

std::string list_text(const std::vector<int>& cpus) {
  std::string text;
  for (const int cpu : cpus) {
    if (!text.empty()) text += ',';
    text += std::to_string(cpu);
  }
  return text;
}

/// Blocks every signal for its lifetime, so that a thread made meanwhile starts with all blocked.
class AllSignalsBlocked {
 public:
  AllSignalsBlocked() {
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  ~AllSignalsBlocked() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  AllSignalsBlocked(const AllSignalsBlocked&) = delete;
  AllSignalsBlocked& operator=(const AllSignalsBlocked&) = delete;

 private:
  sigset_t before_{};
};

std::optional<Error> set_name(const std::string& name) {
  constexpr std::size_t kMaxBytes = 15;  // the kernel's limit without the final zero
  const int code = pthread_setname_np(pthread_self(), name.substr(0, kMaxBytes).c_str());
  if (code == 0) return std::nullopt;
  return errno_error("cannot name a thread '" + name + "'", code);
}

std::optional<Error> set_cpus(const ThreadOptions& options) {
  const std::string what =
      "cannot run thread '" + options.name + "' on CPUs " + list_text(options.cpus);
  const std::string remedy =
      "; choose among the CPUs that `taskset -p 1` and `nproc` show, and "
      "check CPUAffinity= of the service";
  cpu_set_t wanted;
  CPU_ZERO(&wanted);
  for (const int cpu : options.cpus) {
    if (cpu < 0 || cpu >= CPU_SETSIZE)
      return Error{what + ": there is no CPU " + std::to_string(cpu) + remedy, EINVAL};
    CPU_SET(static_cast<std::size_t>(cpu), &wanted);
  }
  Error failure = errno_error(what, pthread_setaffinity_np(pthread_self(), sizeof wanted, &wanted));
  failure.message += remedy;
  if (failure.code != 0) return failure;
  cpu_set_t got;  // the kernel drops absent CPUs from the set without a word
  if (pthread_getaffinity_np(pthread_self(), sizeof got, &got) == 0 && !CPU_EQUAL(&wanted, &got))
    return Error{what + ": some of them are absent or not allowed" + remedy, EINVAL};
  return std::nullopt;
}

std::optional<Error> set_priority(const ThreadOptions& options) {
  sched_param param{};
  param.sched_priority = options.priority;
  // None asked for is the ordinary scheduler, also where a thread with a priority starts this one.
  const int policy = options.priority > 0 ? SCHED_FIFO : SCHED_OTHER;
  const int code = pthread_setschedparam(pthread_self(), policy, &param);
  if (code == 0) return std::nullopt;
  Error failure = errno_error("cannot give thread '" + options.name + "' real-time priority " +
                                  std::to_string(options.priority),
                              code);
  failure.message +=
      "; allow it with LimitRTPRIO= or AmbientCapabilities=CAP_SYS_NICE in the service (by hand: "
      "`ulimit -r`), or set the priority to 0";
  return failure;
}

/// Whether this thread has a real-time priority, its own or that of who started it.
bool has_priority() {
  int policy = SCHED_OTHER;
  sched_param param{};
  return pthread_getschedparam(pthread_self(), &policy, &param) == 0 && policy != SCHED_OTHER &&
         param.sched_priority > 0;
}

std::string joined(const std::vector<Error>& errors) {
  std::string text;
  for (const Error& error : errors) {
    if (!text.empty()) text += "; ";
    text += error.message;
  }
  return text;
}

struct ThreadStart {
  ThreadOptions options;
  std::function<void()> body;
  NamedThread::OnException on_exception;
  std::promise<std::vector<Error>> configured;
};

void thread_top(ThreadStart start) {
  std::vector<Error> shortfalls = configure_this_thread(start.options);
  const bool runs = shortfalls.empty() || !start.options.required;
  start.configured.set_value(std::move(shortfalls));
  if (!runs) return;
  try {
    start.body();
  } catch (...) {
    if (start.on_exception) start.on_exception(start.options.name, std::current_exception());
  }
}

}  // namespace

std::vector<Error> configure_this_thread(const ThreadOptions& options) {
  std::vector<Error> shortfalls;
  const auto note = [&shortfalls](std::optional<Error> error) {
    if (error) shortfalls.push_back(*std::move(error));
  };
  if (!options.name.empty()) note(set_name(options.name));
  if (!options.cpus.empty()) note(set_cpus(options));
  if (options.priority > 0 || has_priority()) note(set_priority(options));
  return shortfalls;
}

Result<NamedThread> NamedThread::start(const ThreadOptions& options, std::function<void()> body,
                                       OnException on_exception) {
  ThreadStart start{options, std::move(body), std::move(on_exception), {}};
  std::future<std::vector<Error>> configured = start.configured.get_future();
  NamedThread made;
  try {
    const AllSignalsBlocked blocked;
    made.thread_ = std::thread(thread_top, std::move(start));
  } catch (const std::system_error& error) {
    return Error{"cannot start thread '" + options.name + "': " + error.what() +
                     "; raise TasksMax= of the service or `ulimit -u`",
                 error.code().value()};
  }
  made.shortfalls_ = configured.get();
  if (options.required && !made.shortfalls_.empty())
    return Error{joined(made.shortfalls_), made.shortfalls_.front().code};
  return made;
}

NamedThread& NamedThread::operator=(NamedThread&& other) noexcept {
  join();
  thread_ = std::move(other.thread_);
  shortfalls_ = std::move(other.shortfalls_);
  return *this;
}

void NamedThread::join() {
  if (thread_.joinable()) thread_.join();
}

}  // namespace loopd
