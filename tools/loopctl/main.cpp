// loopctl: shows what a loopd daemon tells (docs/loopctl.1).

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

#include "session.h"

namespace {

using namespace loopd;

struct SocketChoice {
  std::string path;
  std::string camera = "front";
};

void add_socket_options(CLI::App& command, SocketChoice& choice) {
  command.add_option("--socket", choice.path,
                     "event socket (default: $LOOPD_SOCKET, else /run/loopd/CAMERA/events.sock)");
  command.add_option("--camera", choice.camera, "name of the camera")->capture_default_str();
}

std::string socket_path(const SocketChoice& choice) {
  if (!choice.path.empty()) return choice.path;
  const char* path = std::getenv("LOOPD_SOCKET");  // NOLINT(concurrency-mt-unsafe): one thread
  if (path != nullptr && *path != '\0') return path;
  return "/run/loopd/" + choice.camera + "/events.sock";
}

ClassSet classes_from(const std::vector<std::string>& names) {
  ClassSet classes;
  for (const std::string& name : names) {
    const std::optional<RecordClass> record_class = record_class_from_name(name);
    if (!record_class) {
      throw CLI::ValidationError("--classes",
                                 "\"" + name + "\" is none of loop, candidate, state, stats");
    }
    classes.add(*record_class);
  }
  return classes;
}

std::chrono::milliseconds to_ms(double seconds) {
  return std::chrono::milliseconds(static_cast<std::int64_t>(seconds * 1000));
}

int run(int argc, char** argv) {
  CLI::App app("Shows what a loopd daemon tells about its camera.");
  app.set_version_flag("--version", "loopctl " LOOPD_VERSION);
  app.require_subcommand(1);
  SocketChoice choice;
  constexpr double kMaxSeconds = 1e7;

  loopctl::WatchOptions watch;
  std::vector<std::string> classes{"loop", "state"};
  double watch_timeout_s = 0;
  CLI::App* watch_command = app.add_subcommand("watch", "Print records as they come.");
  add_socket_options(*watch_command, choice);
  watch_command->add_option("--classes", classes, "of loop, candidate, state, stats")
      ->delimiter(',')
      ->capture_default_str();
  watch_command->add_flag("--pairs", watch.request.pairs, "with the inlier pairs (use --json)");
  watch_command->add_flag("--json", watch.json,
                          "print records as they are, one JSON object a line");
  watch_command->add_flag("--retry", watch.retry, "wait for the daemon, also when it goes away");
  CLI::Option* count = watch_command->add_option_function<std::uint64_t>(
      "--count", [&](std::uint64_t n) { watch.count = n; }, "stop after so many loops");
  count->check(CLI::Range(1.0, 1e15));
  watch_command->add_option("--timeout", watch_timeout_s, "stop after so many seconds")
      ->check(CLI::Range(0.001, kMaxSeconds));

  loopctl::StatusOptions status;
  double status_timeout_s = 2;
  CLI::App* status_command = app.add_subcommand("status", "Print the daemon's state and counters.");
  add_socket_options(*status_command, choice);
  status_command->add_flag("--json", status.json, "print one JSON object");
  status_command->add_option("--timeout", status_timeout_s, "seconds to wait for the answer")
      ->check(CLI::Range(0.001, kMaxSeconds))
      ->capture_default_str();

  try {
    app.parse(argc, argv);
    watch.request.classes = classes_from(classes);
    if (watch.count && !watch.request.classes.has(RecordClass::kLoop)) {
      throw CLI::ValidationError("--count", "counts loops, so --classes must hold loop");
    }
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  }
  if (*status_command) {
    status.socket_path = socket_path(choice);
    status.timeout = to_ms(status_timeout_s);
    return loopctl::status(status);
  }
  watch.socket_path = socket_path(choice);
  if (watch_timeout_s > 0) watch.timeout = to_ms(watch_timeout_s);
  return loopctl::watch(watch);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "loopctl: " << error.what() << std::endl;
    return 1;
  }
}
