#pragma once

#include <string>
#include <string_view>

#include "nlohmann/json.hpp"

namespace loopd::loopctl {

using Json = nlohmann::ordered_json;

// Looking into records whose members may be absent or of another type than expected: whatever a
// daemon of another version sends is shown, never an error. All functions are reentrant.

/// A text as JSON; discarded (Json::is_discarded()) if it is none.
Json parse_json(std::string_view text);

/// The member `key` of an object, else null.
const Json& member(const Json& json, const char* key);

/// Text that cannot drive a terminal: control characters become '?'.
std::string printable(std::string text);

/// A value as people write it, printable; "?" if it is not there.
std::string text_of(const Json& value);
std::string text_of(const Json& json, const char* key);

/// A number; `otherwise` if it is none.
double number_of(const Json& json, const char* key, double otherwise = 0);

/// "12.3"
std::string decimal(double value, int digits);

/// A number scaled, with `digits` decimals; "?" if it is not there.
std::string scaled(const Json& value, double scale, int digits);

/// Bytes as "12.3 MiB".
std::string mib(const Json& bytes);

/// As one line, whatever bytes its strings hold.
std::string dump(const Json& json);

}  // namespace loopd::loopctl
