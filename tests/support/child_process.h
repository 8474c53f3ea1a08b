#pragma once

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/unique_fd.h"

extern char** environ;

namespace loopd::testing {

/// A program under test, its output in files. Killed and reaped by the destructor.
class ChildProcess {
 public:
  /// `environment` ("NAME=value") is added to this process's own. `output` is the path to write
  /// standard output to, with ".err" added for standard error.
  ChildProcess(std::vector<std::string> command, const std::string& output,
               const std::vector<std::string>& environment = {})
      : output_(output) {
    std::vector<char*> argv;
    for (std::string& word : command) argv.push_back(word.data());
    argv.push_back(nullptr);
    std::vector<std::string> variables = environment;
    std::vector<char*> envp;
    for (std::string& variable : variables) envp.push_back(variable.data());
    for (char** variable = environ; *variable != nullptr; ++variable) envp.push_back(*variable);
    envp.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC;
    posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, output_.c_str(), kFlags, 0600);
    const std::string errors = output_ + ".err";
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, errors.c_str(), kFlags, 0600);
    const int failed = posix_spawn(&pid_, argv[0], &files, nullptr, argv.data(), envp.data());
    posix_spawn_file_actions_destroy(&files);
    if (failed != 0) throw std::runtime_error("cannot start " + command[0]);
    pidfd_.reset(static_cast<int>(syscall(SYS_pidfd_open, pid_, 0)));  // glibc 2.36 has no C++ form
  }
  ~ChildProcess() {
    if (exit_code_) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  void signal(int number) const { ::kill(pid_, number); }
  int pidfd() const { return pidfd_.get(); }

  /// Waits for the end: the exit code, or 128 + the signal that ended it; none if it runs on.
  std::optional<int> wait(std::chrono::milliseconds timeout = std::chrono::minutes(1)) {
    pollfd ended{pidfd_.get(), POLLIN, 0};
    if (exit_code_ || poll(&ended, 1, static_cast<int>(timeout.count())) != 1) return exit_code_;
    siginfo_t info{};
    if (waitid(P_PIDFD, static_cast<id_t>(pidfd_.get()), &info, WEXITED) != 0) return std::nullopt;
    exit_code_ = info.si_code == CLD_EXITED ? info.si_status : 128 + info.si_status;
    return exit_code_;
  }

  std::string standard_output() const { return content(output_); }
  std::string standard_error() const { return content(output_ + ".err"); }

 private:
  static std::string content(const std::string& path) {
    std::ostringstream text;
    text << std::ifstream(path).rdbuf();
    return text.str();
  }

  std::string output_;
  pid_t pid_ = -1;
  UniqueFd pidfd_;
  std::optional<int> exit_code_;
};

}  // namespace loopd::testing
