// loopctl: shows and changes what a loopd daemon does, and helps to set one up (docs/loopctl.1).

#include <exception>
#include <iostream>

#include "loopctl/command_line.h"

namespace {

int run(int argc, char** argv) {
  CLI::App app("Shows and changes what a loopd daemon does, and helps to set one up.");
  app.set_version_flag("--version", "loopctl " LOOPD_VERSION);
  app.require_subcommand(1);
  loopd::loopctl::Action action;
  loopd::loopctl::add_commands(app, action);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  }
  return action();
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
