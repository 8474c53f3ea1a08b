#pragma once

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace loopd::json_text {

// For the .cpp files of this folder only: nlohmann-json stays out of every other header.
using Json = nlohmann::ordered_json;

/// Compact text; bytes that are not UTF-8 become U+FFFD. Doubles round-trip.
inline std::string dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

/// Sets `key` unless the number is NaN or infinite: JSON has no word for these.
inline void set_finite(Json& json, std::string_view key, double value) {
  if (std::isfinite(value)) json[std::string(key)] = value;
}

template <class T>
void set_known(Json& json, std::string_view key, const std::optional<T>& value) {
  if (value) json[std::string(key)] = *value;
}

/// What a client sent, or why it cannot be understood.
struct ReadRequest {
  std::optional<Json> json;  ///< an object with a text member "op"
  std::string op;
  std::string error;  ///< one sentence, if not
};

/// Reads one request of any bytes. `example_op` is named in the errors. Reentrant.
ReadRequest read_request(std::string_view text, std::string_view example_op);

/// `text` in quotes, cut after 40 bytes: for answers that name a client's own words.
std::string quote(const std::string& text);

}  // namespace loopd::json_text
