#include "app/parameter_text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <numeric>

namespace loopd {
namespace {

bool is_control(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return byte < 0x20 || byte == 0x7f;
}

std::string list_text(const std::vector<int>& values) {
  std::string text = "[";
  for (const int value : values) {
    if (text.size() > 1) text += ", ";
    text += std::to_string(value);
  }
  return text + "]";
}

std::string constraint(std::string_view key, const std::string& value, const std::string& rule) {
  return std::string(key) + " = " + value + ". Violated constraint: " + std::string(key) + " " +
         rule;
}

/// ">= min" or "<= max", whichever `value` violates (NaN: both, the second is named).
std::optional<std::string> number_rule(double value, double min, double max) {
  if (value >= min && value <= max) return std::nullopt;
  return value < min ? ">= " + number_text(min) : "<= " + number_text(max);
}

std::optional<std::string> string_rule(const std::string& value, double min, double max) {
  const auto bytes = static_cast<double>(value.size());
  if (bytes < min) return "is at least " + number_text(min) + " bytes long";
  if (bytes > max)
    return "is at most " + number_text(max) + " bytes long (it has " + number_text(bytes) + ")";
  if (std::ranges::any_of(value, is_control)) return "holds no control characters";
  return std::nullopt;
}

std::optional<std::string> list_rule(const std::vector<int>& values, double min, double max) {
  constexpr std::size_t kLongest = 1024;
  if (values.size() > kLongest) return "has at most " + std::to_string(kLongest) + " elements";
  for (const int value : values)
    if (const auto rule = number_rule(value, min, max)) return "has only elements " + *rule;
  return std::nullopt;
}

std::optional<std::string> rule_violated(const ParameterRef& ref, double min, double max) {
  if (const auto* const* value = std::get_if<int*>(&ref)) return number_rule(**value, min, max);
  if (const auto* const* value = std::get_if<double*>(&ref)) return number_rule(**value, min, max);
  if (const auto* const* value = std::get_if<std::string*>(&ref))
    return string_rule(**value, min, max);
  if (const auto* const* value = std::get_if<std::vector<int>*>(&ref))
    return list_rule(**value, min, max);
  return std::nullopt;
}

/// Levenshtein distance: insertions, deletions and replacements of one character.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

}  // namespace

std::string number_text(double value) {
  std::array<char, 32> text{};
  const bool whole = value == std::floor(value) && std::abs(value) < 1e15;
  const auto end =
      whole ? std::to_chars(text.data(), text.data() + text.size(), static_cast<long long>(value))
            : std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end.ptr};
}

std::string toml_string(std::string_view text) {
  constexpr std::string_view kHex = "0123456789abcdef";
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    if (is_control(c)) {
      const auto byte = static_cast<unsigned char>(c);
      quoted += "\\u00";
      quoted += kHex[byte >> 4];
      quoted += kHex[byte & 0xf];
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

std::string toml_value(const ParameterRef& ref) {
  if (const auto* const* value = std::get_if<bool*>(&ref)) return **value ? "true" : "false";
  if (const auto* const* value = std::get_if<int*>(&ref)) return std::to_string(**value);
  if (const auto* const* value = std::get_if<std::string*>(&ref)) return toml_string(**value);
  if (const auto* const* value = std::get_if<std::vector<int>*>(&ref)) return list_text(**value);
  const std::string text = number_text(**std::get_if<double*>(&ref));
  const bool reads_as_integer = text.find_first_not_of("-0123456789") == std::string::npos;
  return reads_as_integer ? text + ".0" : text;
}

std::string_view type_name(const ParameterRef& ref) {
  constexpr std::array<std::string_view, std::variant_size_v<ParameterRef>> kNames = {
      "true or false", "a whole number", "a number", "text in quotes", "a list of whole numbers"};
  return kNames[ref.index()];
}

std::string range_text(const ParameterRef& ref, double min, double max) {
  const std::string range = number_text(min) + " .. " + number_text(max);
  if (std::holds_alternative<bool*>(ref)) return "true or false";
  if (std::holds_alternative<std::string*>(ref)) return "text of " + range + " bytes";
  if (std::holds_alternative<std::vector<int>*>(ref)) return "list of " + range;
  return range;
}

std::optional<std::string> range_violation(std::string_view key, const ParameterRef& ref,
                                           double min, double max) {
  const std::optional<std::string> rule = rule_violated(ref, min, max);
  if (!rule) return std::nullopt;
  constexpr std::size_t kLongestShown = 200;
  std::string value = toml_value(ref);
  if (value.size() > kLongestShown) value = value.substr(0, kLongestShown) + "...";
  return constraint(key, value, *rule);
}

std::optional<std::string_view> nearest_name(std::string_view name,
                                             const std::vector<std::string_view>& names) {
  constexpr std::size_t kLongestName = 100;  // bounds the time an absurd name costs
  if (name.size() > kLongestName) return std::nullopt;
  std::optional<std::string_view> nearest;
  std::size_t nearest_distance = std::max<std::size_t>(2, name.size() / 3) + 1;
  for (const std::string_view candidate : names) {
    const std::string_view without_section = candidate.substr(candidate.find('.') + 1);
    const bool has_section = name.find('.') != std::string_view::npos;
    const std::size_t distance = edit_distance(name, has_section ? candidate : without_section);
    if (distance >= nearest_distance) continue;
    nearest_distance = distance;
    nearest = candidate;
  }
  return nearest;
}

}  // namespace loopd
