#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "capture/v4l2_io.h"

namespace loopd {

/// A control's name as v4l2-ctl writes it: "Exposure Time, Absolute" is "exposure_time_absolute".
std::string control_name(std::string_view driver_name);

/// Sets `controls` (name, value as text) in their order. Values are whole numbers, "true" or
/// "false". Returns a sentence for each that could not be set, with the reason.
std::vector<std::string> set_controls(
    const V4l2Node& node, const std::vector<std::pair<std::string, std::string>>& controls);

}  // namespace loopd
