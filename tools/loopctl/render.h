#pragma once

#include <string>

#include "loopctl/json_view.h"

namespace loopd::loopctl {

/// One record as a line for people, without the time and the newline; empty for records that
/// people need not see. Unknown classes and fields of unexpected type are shown, never an error.
std::string record_line(const Json& record);

/// What loopctl status shows: `hello` always, `state` and `stats` null if the daemon has none yet.
std::string status_block(const Json& hello, const Json& state, const Json& stats,
                         const std::string& socket_path);

/// Local time of day, "12:03:04.512".
std::string time_of_day();

}  // namespace loopd::loopctl
