#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "loopd/config.h"

namespace loopd {

// The text of parameters and of what is wrong with them. Reentrant.

/// Shortest text that reads back as exactly `value`, without an exponent where that is readable.
std::string number_text(double value);

/// `text` as a TOML basic string, quotes included.
std::string toml_string(std::string_view text);

/// The value behind `ref` as TOML.
std::string toml_value(const ParameterRef& ref);

/// What a value of this type looks like, for messages: "a whole number", "true or false", ...
std::string_view type_name(const ParameterRef& ref);

/// "true or false", "0 .. 100", "text of 1 .. 64 bytes", "list of 0 .. 1023".
std::string range_text(const ParameterRef& ref, double min, double max);

/// "key = value. Violated constraint: key <= max" and the like, or nothing if the value is in
/// range. Numbers and elements of lists are bounded by min and max, strings in bytes; strings hold
/// no control characters.
std::optional<std::string> range_violation(std::string_view key, const ParameterRef& ref,
                                           double min, double max);

/// The name nearest to `name` in edit distance, if it is near enough to be what was meant. A name
/// without its section ("points") finds the one with it ("features.points").
std::optional<std::string_view> nearest_name(std::string_view name,
                                             const std::vector<std::string_view>& names);

}  // namespace loopd
