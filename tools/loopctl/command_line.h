#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace loopd::loopctl {

/// What the command line asks for: runs it and returns the exit status.
using Action = std::function<int()>;

/// Adds every command and its options to `app`; parsing sets `action`, or throws what is wrong as
/// CLI::ParseError.
void add_commands(CLI::App& app, Action& action);

}  // namespace loopd::loopctl
