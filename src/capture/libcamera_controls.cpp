#include "capture/libcamera_controls.h"

#include <libcamera/control_ids.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>

namespace loopd {
namespace {

using libcamera::ControlInfo;
using libcamera::ControlInfoMap;
using libcamera::ControlValue;

constexpr double kMicroseconds = 1e6;

template <class T>
std::optional<T> number(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  if constexpr (std::is_floating_point_v<T>)
    if (!std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<ControlValue> bool_value(std::string_view text) {
  if (text == "true" || text == "on" || text == "1") return ControlValue(true);
  if (text == "false" || text == "off" || text == "0") return ControlValue(false);
  return std::nullopt;
}

// One number, or several with commas between them.
template <class T>
std::optional<ControlValue> numeric_value(std::string_view text) {
  std::vector<T> numbers;
  while (true) {
    const std::size_t comma = text.find(',');
    const auto next = number<T>(text.substr(0, comma));
    if (!next) return std::nullopt;
    numbers.push_back(*next);
    if (comma == std::string_view::npos) break;
    text.remove_prefix(comma + 1);
  }
  if (numbers.size() == 1) return ControlValue(numbers.front());
  return ControlValue(libcamera::Span<const T>(numbers.data(), numbers.size()));
}

template <class T>
std::optional<double> scalar_as(const ControlValue& value) {
  return static_cast<double>(value.get<T>());
}

// A scalar as a number to compare; none for everything else.
std::optional<double> scalar(const ControlValue& value) {
  if (value.isArray()) return std::nullopt;
  switch (value.type()) {
    case libcamera::ControlTypeByte:
      return scalar_as<std::uint8_t>(value);
    case libcamera::ControlTypeInteger32:
      return scalar_as<std::int32_t>(value);
    case libcamera::ControlTypeInteger64:
      return scalar_as<std::int64_t>(value);
    case libcamera::ControlTypeFloat:
      return scalar_as<float>(value);
    default:
      return std::nullopt;
  }
}

bool within_limits(const ControlInfo& info, const ControlValue& value) {
  const auto wanted = scalar(value);
  const auto least = scalar(info.min());
  const auto most = scalar(info.max());
  return !wanted || ((!least || *wanted >= *least) && (!most || *wanted <= *most));
}

ControlInfoMap::const_iterator find_by_name(const ControlInfoMap& known, const std::string& name) {
  return std::find_if(known.begin(), known.end(),
                      [&](const auto& entry) { return entry.first->name() == name; });
}

std::string number_text(double value) {
  std::array<char, 32> text{};
  const int length = std::snprintf(text.data(), text.size(), "%.6g", value);
  return {text.data(), static_cast<std::size_t>(std::max(length, 0))};
}

// Why a setting cannot be had; empty, with the value added to `list`, if it can.
std::string add_control(const ControlInfoMap& known, const std::string& name,
                        const std::string& text, libcamera::ControlList& list) {
  const auto entry = find_by_name(known, name);
  if (entry == known.end()) return "this camera has no such control";
  const auto value = control_value(entry->first->type(), text);
  if (!value) return "that is no value of this control";
  if (!within_limits(entry->second, *value))
    return "it goes from " + entry->second.min().toString() + " to " +
           entry->second.max().toString();
  list.set(entry->first->id(), *value);
  return "";
}

}  // namespace

std::optional<ControlValue> control_value(libcamera::ControlType type, std::string_view text) {
  switch (type) {
    case libcamera::ControlTypeBool:
      return bool_value(text);
    case libcamera::ControlTypeByte:
      return numeric_value<std::uint8_t>(text);
    case libcamera::ControlTypeInteger32:
      return numeric_value<std::int32_t>(text);
    case libcamera::ControlTypeInteger64:
      return numeric_value<std::int64_t>(text);
    case libcamera::ControlTypeFloat:
      return numeric_value<float>(text);
    default:
      return std::nullopt;
  }
}

void add_controls(const ControlInfoMap& known,
                  std::span<const std::pair<std::string, std::string>> settings,
                  libcamera::ControlList& list, std::vector<std::string>& warnings) {
  for (const auto& [name, text] : settings) {
    const std::string problem = add_control(known, name, text, list);
    if (!problem.empty())
      warnings.push_back("cannot set the control " + name + " to " + text + ": " + problem);
  }
}

double add_frame_rate(const ControlInfoMap& known, double fps, libcamera::ControlList& list,
                      std::vector<std::string>& warnings) {
  const auto entry = known.find(libcamera::controls::FrameDurationLimits.id());
  if (entry == known.end()) {
    warnings.push_back("cannot set the rate to " + number_text(fps) +
                       " frames a second: libcamera does not offer it for this camera");
    return 0;
  }
  const double wanted_us = kMicroseconds / fps;
  const double least_us = scalar(entry->second.min()).value_or(wanted_us);
  const double most_us = std::max(scalar(entry->second.max()).value_or(wanted_us), least_us);
  const double duration_us = std::clamp(wanted_us, least_us, most_us);
  if (!(duration_us >= 1 && duration_us < 1e12)) return 0;
  if (std::abs(duration_us - wanted_us) > 0.01 * wanted_us)
    warnings.push_back("the camera gives " + number_text(kMicroseconds / duration_us) +
                       " instead of " + number_text(fps) + " frames a second");
  const std::array<std::int64_t, 2> limits{std::llround(duration_us), std::llround(duration_us)};
  list.set(libcamera::controls::FrameDurationLimits,
           libcamera::Span<const std::int64_t, 2>(limits));
  return kMicroseconds / static_cast<double>(limits[0]);
}

}  // namespace loopd
