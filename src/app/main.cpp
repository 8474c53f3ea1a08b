// The daemon's command line. Everything it does is in Daemon; everything it is told, in the config.
#include <signal.h>

#include <CLI/CLI.hpp>
#include <exception>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include "app/config_file.h"
#include "app/daemon.h"
#include "app/memory_plan.h"
#include "base/log.h"

namespace {

using namespace loopd;

// Exit codes, as in loopd(8).
constexpr int kEnded = 0;        // by SIGTERM, SIGINT or the end of a recording
constexpr int kFailed = 1;       // could not start, or broke while running: worth a restart
constexpr int kBadSettings = 2;  // command line or config: no restart helps

struct CommandLine {
  std::optional<std::string> config_path;
  std::vector<std::string> sets;
  bool check = false;
  bool print_config = false;
};

/// Parses the command line; an exit code if the process shall end at once.
std::optional<int> parse(int argc, char** argv, CommandLine& line) {
  CLI::App app("loopd: tells a robot when its camera sees a place it has seen before");
  app.add_option("--config", line.config_path, "Config file, see loopd.toml(5)")->type_name("FILE");
  app.add_option("--set", line.sets, "Set one parameter, over the config file; may be repeated")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_flag("--check", line.check, "Validate the config, print it and what it costs in memory");
  app.add_flag("--print-config", line.print_config, "Print the config with every parameter");
  app.set_version_flag("--version", "loopd " LOOPD_VERSION);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& stop) {
    return app.exit(stop) == 0 ? kEnded : kBadSettings;
  }
  return std::nullopt;
}

/// Signals come to the main thread's event loop, and by no other way.
void block_signals() {
  sigset_t all;
  sigfillset(&all);
  for (const int fault : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGTRAP})
    sigdelset(&all, fault);
  pthread_sigmask(SIG_SETMASK, &all, nullptr);
  signal(SIGPIPE, SIG_IGN);
}

/// The config file with what the command line sets over it.
LoadedConfig read_config(const CommandLine& line) {
  LoadedConfig loaded = load_config(line.config_path, line.sets);
  if (!line.print_config)
    for (std::string& missing : missing_for_daemon(loaded.config))
      loaded.mistakes.push_back(std::move(missing));
  return loaded;
}

int run_daemon(const DaemonConfig& config, const CommandLine& line, const Log& log) {
  block_signals();
  auto daemon = Daemon::start(
      config, [&line] { return read_config(line); }, log, LOOPD_VERSION);
  if (!daemon) {
    log.error(daemon.error().message);
    return kFailed;
  }
  if (const Status ended = daemon.value()->run(); !ended) {
    log.error(ended.error().message);
    return kFailed;
  }
  log.notice("ended");
  return kEnded;
}

int run(int argc, char** argv, const Log& log) {
  CommandLine line;
  if (const auto exit_code = parse(argc, argv, line)) return *exit_code;
  const LoadedConfig loaded = read_config(line);
  for (const std::string& mistake : loaded.mistakes) log.error(mistake);
  if (!loaded.ok()) return kBadSettings;
  if (line.print_config || line.check) std::cout << config_as_toml(loaded.config);
  if (line.check) std::cout << "\n" << memory_text(memory_plan(loaded.config));
  if (line.print_config || line.check) return std::cout.flush() ? kEnded : kFailed;
  return run_daemon(loaded.config, line, log);
}

}  // namespace

int main(int argc, char** argv) {
  const Log log = Log::to_stderr();
  try {
    return run(argc, argv, log);
  } catch (const std::exception& error) {
    log.error(error.what());
    return kFailed;
  }
}
