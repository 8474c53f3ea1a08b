#include "loopctl/json_view.h"

#include <algorithm>
#include <array>
#include <cstdio>

namespace loopd::loopctl {

Json parse_json(std::string_view text) { return Json::parse(text, nullptr, false); }

const Json& member(const Json& json, const char* key) {
  static const Json kNull;
  if (!json.is_object()) return kNull;
  const auto it = json.find(key);
  return it == json.end() ? kNull : *it;
}

std::string printable(std::string text) {
  const auto is_control = [](unsigned char c) { return c < 0x20 || c == 0x7f; };
  std::replace_if(text.begin(), text.end(), is_control, '?');
  return text;
}

std::string text_of(const Json& value) {
  if (value.is_null()) return "?";
  if (value.is_string()) return printable(value.get<std::string>());
  return dump(value);
}

std::string text_of(const Json& json, const char* key) { return text_of(member(json, key)); }

double number_of(const Json& json, const char* key, double otherwise) {
  const Json& value = member(json, key);
  return value.is_number() ? value.get<double>() : otherwise;
}

std::string decimal(double value, int digits) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.*f", digits, value);
  return text.data();
}

std::string scaled(const Json& value, double scale, int digits) {
  return value.is_number() ? decimal(value.get<double>() * scale, digits) : "?";
}

std::string mib(const Json& bytes) { return scaled(bytes, 1.0 / (1024 * 1024), 1) + " MiB"; }

std::string dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace loopd::loopctl
