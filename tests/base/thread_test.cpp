#include "base/thread.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>

#include <stdexcept>

namespace loopd {
namespace {

using testing::HasSubstr;

/// The CPUs of `set`, ascending.
std::vector<int> cpus_of(const cpu_set_t& set) {
  std::vector<int> cpus;
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu)
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &set)) cpus.push_back(cpu);
  return cpus;
}

std::vector<int> my_cpus() {
  cpu_set_t set;
  CPU_ZERO(&set);
  EXPECT_EQ(sched_getaffinity(0, sizeof set, &set), 0);
  return cpus_of(set);
}

TEST(NamedThread, HasItsNameCutToWhatTheKernelKeeps) {
  std::string seen(16, '\0');
  const auto read_name = [&seen] { pthread_getname_np(pthread_self(), seen.data(), seen.size()); };
  auto thread = NamedThread::start({.name = "a-name-of-19-letters"}, read_name, nullptr);
  ASSERT_TRUE(thread.ok());
  thread->join();
  EXPECT_STREQ(seen.c_str(), "a-name-of-19-le");
  EXPECT_TRUE(thread->shortfalls().empty());
}

TEST(NamedThread, BlocksEverySignalAndLeavesTheStarterAlone) {
  sigset_t before;
  pthread_sigmask(SIG_SETMASK, nullptr, &before);
  sigset_t inside;
  sigemptyset(&inside);
  const auto read_mask = [&inside] { pthread_sigmask(SIG_SETMASK, nullptr, &inside); };
  auto thread = NamedThread::start({.name = "mask"}, read_mask, nullptr);
  ASSERT_TRUE(thread.ok());
  thread->join();
  for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGCHLD, SIGPIPE, SIGUSR1})
    EXPECT_EQ(sigismember(&inside, signal), 1) << signal;
  sigset_t after;
  pthread_sigmask(SIG_SETMASK, nullptr, &after);
  EXPECT_EQ(sigismember(&before, SIGTERM), sigismember(&after, SIGTERM));
}

TEST(NamedThread, RunsOnTheCpusAskedFor) {
  const int cpu = my_cpus().back();
  std::vector<int> seen;
  auto thread = NamedThread::start(
      {.name = "pinned", .cpus = {cpu}}, [&seen] { seen = my_cpus(); }, nullptr);
  ASSERT_TRUE(thread.ok());
  thread->join();
  EXPECT_EQ(seen, std::vector<int>{cpu});
}

TEST(NamedThread, RunsWithoutCpusItCannotHaveAndSaysSo) {
  bool ran = false;
  const ThreadOptions options{.name = "lost", .cpus = {CPU_SETSIZE - 1}};
  auto thread = NamedThread::start(
      options, [&ran] { ran = true; }, nullptr);
  ASSERT_TRUE(thread.ok());
  thread->join();
  EXPECT_TRUE(ran);
  ASSERT_EQ(thread->shortfalls().size(), 1u);
  EXPECT_THAT(thread->shortfalls()[0].message, HasSubstr("'lost' on CPUs 1023"));
  EXPECT_THAT(thread->shortfalls()[0].message, HasSubstr("choose among the CPUs"));
}

TEST(NamedThread, NoticesThatTheKernelDroppedSomeOfTheCpus) {
  auto thread = NamedThread::start(
      {.name = "half", .cpus = {my_cpus().front(), CPU_SETSIZE - 1}}, [] {}, nullptr);
  ASSERT_TRUE(thread.ok());
  ASSERT_EQ(thread->shortfalls().size(), 1u);
  EXPECT_THAT(thread->shortfalls()[0].message, HasSubstr("absent or not allowed"));
}

TEST(NamedThread, NegativeAndHugeCpuNumbersAreNamed) {
  for (const int cpu : {-1, 1 << 20}) {
    auto thread = NamedThread::start(
        {.name = "odd", .cpus = {cpu}}, [] {}, nullptr);
    ASSERT_TRUE(thread.ok());
    ASSERT_EQ(thread->shortfalls().size(), 1u);
    EXPECT_THAT(thread->shortfalls()[0].message,
                HasSubstr("there is no CPU " + std::to_string(cpu)));
  }
}

TEST(NamedThread, DoesNotStartWithoutWhatIsRequired) {
  bool ran = false;
  const ThreadOptions options{.name = "must", .cpus = {-1}, .required = true};
  const auto thread = NamedThread::start(
      options, [&ran] { ran = true; }, nullptr);
  ASSERT_FALSE(thread.ok());
  EXPECT_THAT(thread.error().message, HasSubstr("'must'"));
  EXPECT_FALSE(ran);
}

TEST(NamedThread, WithoutAPriorityItHasTheOrdinarySchedulerWhoeverStartsIt) {
  int policy = -1;
  const auto start_another = [&policy] {
    auto inner = NamedThread::start(
        {.name = "inner"}, [&policy] { policy = sched_getscheduler(0); }, nullptr);
    ASSERT_TRUE(inner.ok());
  };
  { auto outer = NamedThread::start({.name = "outer", .priority = 7}, start_another, nullptr); }
  EXPECT_EQ(policy, SCHED_OTHER);
}

// Whether a real-time priority may be had depends on the machine; it is had, or the remedy named.
TEST(NamedThread, HasItsPriorityOrSaysHowToGetIt) {
  int policy = -1;
  sched_param param{};
  const auto read_policy = [&] { pthread_getschedparam(pthread_self(), &policy, &param); };
  auto thread = NamedThread::start({.name = "fifo", .priority = 7}, read_policy, nullptr);
  ASSERT_TRUE(thread.ok());
  thread->join();
  if (thread->shortfalls().empty()) {
    EXPECT_EQ(policy, SCHED_FIFO);
    EXPECT_EQ(param.sched_priority, 7);
  } else {
    EXPECT_EQ(policy, SCHED_OTHER);
    EXPECT_THAT(thread->shortfalls()[0].message, HasSubstr("LimitRTPRIO="));
  }
}

TEST(NamedThread, ReportsWhatEscapesItsBody) {
  std::string report;
  const auto note = [&report](const std::string& name, std::exception_ptr exception) {
    try {
      std::rethrow_exception(exception);
    } catch (const std::exception& error) {
      report = name + ": " + error.what();
    }
  };
  auto thread = NamedThread::start(
      {.name = "thrower"}, [] { throw std::runtime_error("broken"); }, note);
  ASSERT_TRUE(thread.ok());
  thread->join();
  EXPECT_EQ(report, "thrower: broken");
}

TEST(NamedThread, AssignmentJoinsTheOldThread) {
  bool first_ran = false;
  NamedThread thread = NamedThread::start(
                           {.name = "1"}, [&] { first_ran = true; }, nullptr)
                           .value();
  thread = NamedThread::start(
               {.name = "2"}, [] {}, nullptr)
               .value();
  EXPECT_TRUE(first_ran);
}

}  // namespace
}  // namespace loopd
