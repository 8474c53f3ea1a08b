#include "loopctl/command_line.h"

#include <unistd.h>

#include <cstdlib>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include "loopctl/cameras.h"
#include "loopctl/control.h"
#include "loopctl/doctor.h"
#include "loopctl/record.h"
#include "loopctl/session.h"

namespace loopd::loopctl {

namespace {

constexpr double kMaxSeconds = 1e7;

std::chrono::milliseconds to_ms(double seconds) {
  return std::chrono::milliseconds(static_cast<std::int64_t>(seconds * 1000));
}

/// Which daemon: one of its sockets, or the camera that it is named after.
struct SocketChoice {
  std::string path;
  std::string camera = "front";
};

/// `variable` names the environment variable that stands in for the option.
std::string socket_path(const SocketChoice& choice, const char* variable, const char* file) {
  if (!choice.path.empty()) return choice.path;
  const char* path = std::getenv(variable);  // NOLINT(concurrency-mt-unsafe): one thread
  if (path != nullptr && *path != '\0') return path;
  return "/run/loopd/" + choice.camera + "/" + file;
}

std::string event_socket(const SocketChoice& choice) {
  return socket_path(choice, "LOOPD_SOCKET", "events.sock");
}

std::string control_socket(const SocketChoice& choice) {
  return socket_path(choice, "LOOPD_CONTROL", "control.sock");
}

void add_camera_option(CLI::App& command, SocketChoice& choice) {
  command.add_option("--camera", choice.camera, "name of the camera")->capture_default_str();
}

void add_event_socket_options(CLI::App& command, SocketChoice& choice) {
  command.add_option("--socket", choice.path,
                     "event socket (default: $LOOPD_SOCKET, else /run/loopd/CAMERA/events.sock)");
  add_camera_option(command, choice);
}

void add_control_socket_options(CLI::App& command, SocketChoice& choice) {
  command.add_option(
      "--control", choice.path,
      "control socket (default: $LOOPD_CONTROL, else /run/loopd/CAMERA/control.sock)");
  add_camera_option(command, choice);
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

struct WatchArguments {
  WatchOptions options;
  SocketChoice socket;
  std::vector<std::string> classes{"loop", "state"};
  double timeout_s = 0;
};

/// Throws CLI::ValidationError.
WatchOptions watch_options(const WatchArguments& arguments) {
  WatchOptions options = arguments.options;
  options.socket_path = event_socket(arguments.socket);
  options.request.classes = classes_from(arguments.classes);
  if (options.count && !options.request.classes.has(RecordClass::kLoop)) {
    throw CLI::ValidationError("--count", "counts loops, so --classes must hold loop");
  }
  if (arguments.timeout_s > 0) options.timeout = to_ms(arguments.timeout_s);
  return options;
}

void add_watch(CLI::App& app, Action& action) {
  CLI::App& command = *app.add_subcommand("watch", "Print records as they come.");
  const auto arguments = std::make_shared<WatchArguments>();
  add_event_socket_options(command, arguments->socket);
  command.add_option("--classes", arguments->classes, "of loop, candidate, state, stats")
      ->delimiter(',')
      ->capture_default_str();
  command.add_flag("--pairs", arguments->options.request.pairs,
                   "with the inlier pairs (use --json)");
  command.add_flag("--json", arguments->options.json,
                   "print records as they are, one JSON object a line");
  command.add_flag("--retry", arguments->options.retry,
                   "wait for the daemon, also when it goes away");
  command
      .add_option_function<std::uint64_t>(
          "--count", [arguments](std::uint64_t n) { arguments->options.count = n; },
          "stop after so many loops")
      ->check(CLI::Range(1.0, 1e15));
  command.add_option("--timeout", arguments->timeout_s, "stop after so many seconds")
      ->check(CLI::Range(0.001, kMaxSeconds));
  command.callback([arguments, &action] {
    action = [options = watch_options(*arguments)] { return watch(options); };
  });
}

void add_status(CLI::App& app, Action& action) {
  struct Arguments {
    StatusOptions options;
    SocketChoice socket;
    double timeout_s = 2;
  };
  CLI::App& command = *app.add_subcommand("status", "Print the daemon's state and counters.");
  const auto arguments = std::make_shared<Arguments>();
  add_event_socket_options(command, arguments->socket);
  command.add_flag("--json", arguments->options.json, "print one JSON object");
  command.add_option("--timeout", arguments->timeout_s, "seconds to wait for the answer")
      ->check(CLI::Range(0.001, kMaxSeconds))
      ->capture_default_str();
  command.callback([arguments, &action] {
    StatusOptions options = arguments->options;
    options.socket_path = event_socket(arguments->socket);
    options.timeout = to_ms(arguments->timeout_s);
    action = [options] { return status(options); };
  });
}

void add_control(CLI::App& app, Action& action, ControlOp op, const char* help) {
  struct Arguments {
    ControlCommand command;
    SocketChoice socket;
  };
  CLI::App& command = *app.add_subcommand(std::string(control_op_name(op)), help);
  const auto arguments = std::make_shared<Arguments>();
  arguments->command.op = op;
  add_control_socket_options(command, arguments->socket);
  command.add_flag("--json", arguments->command.json, "print the daemon's answer as it is");
  command.callback([arguments, &action] {
    arguments->command.control_path = control_socket(arguments->socket);
    action = [arguments] { return control(arguments->command, std::cout, std::cerr); };
  });
}

void add_record(CLI::App& app, Action& action) {
  struct Arguments {
    RecordCommand command;
    SocketChoice socket;
    std::uint64_t max_mib = RecordLimits{}.max_bytes >> 20;
  };
  CLI::App& command =
      *app.add_subcommand("record", "Have the daemon write what its camera gives into a file.");
  const auto arguments = std::make_shared<Arguments>();
  command.add_option("FILE", arguments->command.file, "the file to make")->required();
  add_control_socket_options(command, arguments->socket);
  command.add_option("--seconds", arguments->command.limits.seconds, "end after so long")
      ->check(CLI::Range(0.001, RecordLimits::kMaxSeconds))
      ->capture_default_str();
  command.add_option("--max-mib", arguments->max_mib, "end before the file is larger")
      ->check(CLI::Range(std::uint64_t{1}, RecordLimits::kMaxMib))
      ->capture_default_str();
  command.add_flag("--force", arguments->command.force, "replace a file that is there");
  command.callback([arguments, &action] {
    arguments->command.control_path = control_socket(arguments->socket);
    arguments->command.limits.max_bytes = arguments->max_mib << 20;
    arguments->command.progress = isatty(STDERR_FILENO) == 1;
    action = [arguments] { return record(arguments->command, std::cout, std::cerr); };
  });
}

void add_cameras(CLI::App& app, Action& action) {
  CLI::App& command = *app.add_subcommand("cameras", "List the cameras that could be opened.");
  const auto json = std::make_shared<bool>(false);
  command.add_flag("--json", *json, "print one JSON object");
  command.callback([json, &action] { action = [json] { return cameras(*json, std::cout); }; });
}

/// What is wrong with a name that goes into paths and names of units; empty if nothing is.
std::string camera_name(const std::string& name) {
  const bool good = !name.empty() && name.size() <= 64 &&
                    name.find_first_not_of(
                        "abcdefghijklmnopqrstuvwxyz"
                        "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_") == std::string::npos;
  return good ? "" : "a camera's name has letters, digits, - and _ only";
}

void add_doctor(CLI::App& app, Action& action) {
  CLI::App& command = *app.add_subcommand("doctor", "Look for what is wrong, and say what to do.");
  const auto options = std::make_shared<DoctorOptions>();
  command.add_option("NAME", options->name, "name of the camera")
      ->check(camera_name)
      ->capture_default_str();
  command.add_option("--config", options->config,
                     "its config file (default: /etc/loopd/NAME.toml)");
  command.add_flag("--json", options->json, "print one JSON object");
  command.add_flag("--no-trial", options->no_trial, "do not take images from the camera");
  command.callback(
      [options, &action] { action = [options] { return doctor(*options, std::cout); }; });
}

}  // namespace

void add_commands(CLI::App& app, Action& action) {
  add_watch(app, action);
  add_status(app, action);
  add_control(app, action, ControlOp::kPause, "Let the daemon rest: images are thrown away.");
  add_control(app, action, ControlOp::kResume, "Let it go on.");
  add_control(app, action, ControlOp::kReset, "Forget all images: begin with an empty map.");
  add_control(app, action, ControlOp::kReload, "Read the config file again.");
  add_record(app, action);
  add_cameras(app, action);
  add_doctor(app, action);
}

}  // namespace loopd::loopctl
