#pragma once

#include <libcamera/controls.h>

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace loopd {

/// The value of `type` that `text` writes: a number, or true/false/on/off/1/0 for a bool; several
/// numbers with commas between them for an array. None if it is no such value, or if values of that
/// type cannot be given as text here (sizes, rectangles, text). Reentrant.
std::optional<libcamera::ControlValue> control_value(libcamera::ControlType type,
                                                     std::string_view text);

/// Adds the settings (a name and a value each) to `list`. What is not among `known`, is no value of
/// it, or lies outside its limits is left out and gets one sentence in `warnings`.
void add_controls(const libcamera::ControlInfoMap& known,
                  std::span<const std::pair<std::string, std::string>> settings,
                  libcamera::ControlList& list, std::vector<std::string>& warnings);

/// Asks for `fps` frames a second by FrameDurationLimits and returns what was asked for, bounded by
/// what the camera knows; 0 if it cannot be set. A difference is a warning.
double add_frame_rate(const libcamera::ControlInfoMap& known, double fps,
                      libcamera::ControlList& list, std::vector<std::string>& warnings);

}  // namespace loopd
