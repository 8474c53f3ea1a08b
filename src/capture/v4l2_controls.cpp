#include "capture/v4l2_controls.h"

#include <linux/videodev2.h>

#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <optional>
#include <system_error>

namespace loopd {
namespace {

constexpr int kMaxControls = 1024;  // a driver that lists more goes in circles

struct Control {
  std::string name;
  std::uint32_t id = 0;
  std::uint32_t flags = 0;
  std::int32_t least = 0;
  std::int32_t most = 0;
};

std::vector<Control> list_controls(const V4l2Node& node) {
  std::vector<Control> controls;
  v4l2_queryctrl query{};
  for (int i = 0; i < kMaxControls; ++i) {
    const std::uint32_t last = query.id;
    query = {};
    query.id = last | V4L2_CTRL_FLAG_NEXT_CTRL;
    if (node.call(VIDIOC_QUERYCTRL, query) < 0 || query.id <= last) break;
    const auto* text = reinterpret_cast<const char*>(query.name);
    controls.push_back({control_name({text, ::strnlen(text, sizeof query.name)}), query.id,
                        query.flags, query.minimum, query.maximum});
  }
  return controls;
}

std::optional<std::int32_t> control_value(std::string_view text) {
  if (text == "true") return 1;
  if (text == "false") return 0;
  std::int32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::string refusal(const Control& control, int result) {
  std::string reason = std::generic_category().message(-result);
  if ((control.flags & V4L2_CTRL_FLAG_READ_ONLY) != 0) return reason + ", it is read-only";
  if ((control.flags & V4L2_CTRL_FLAG_INACTIVE) != 0)
    return reason +
           ", it is inactive: set the control that governs it (such as auto_exposure) "
           "before it";
  return reason;
}

// Why `control` could not be set; none if it was.
std::optional<std::string> set_control(const V4l2Node& node, const Control& control,
                                       const std::string& text) {
  const std::optional<std::int32_t> value = control_value(text);
  if (!value) return "its value is a whole number, true or false";
  if (*value < control.least || *value > control.most)
    return "its range is " + std::to_string(control.least) + " to " + std::to_string(control.most);
  v4l2_control setting{};
  setting.id = control.id;
  setting.value = *value;
  if (const int result = node.call(VIDIOC_S_CTRL, setting); result < 0)
    return refusal(control, result);
  if (setting.value != *value) return "the driver made it " + std::to_string(setting.value);
  return std::nullopt;
}

std::optional<std::string> set_by_name(const V4l2Node& node, const std::vector<Control>& known,
                                       const std::string& name, const std::string& value) {
  for (const Control& control : known)
    if (control.name == control_name(name)) return set_control(node, control, value);
  return "the camera has no such control; v4l2-ctl -L lists those it has";
}

}  // namespace

std::string control_name(std::string_view driver_name) {
  std::string name;
  bool gap = false;
  for (const char letter : driver_name) {
    const bool upper = letter >= 'A' && letter <= 'Z';
    const bool kept = upper || (letter >= 'a' && letter <= 'z') || (letter >= '0' && letter <= '9');
    if (kept && gap && !name.empty()) name += '_';
    gap = !kept;
    if (kept) name += upper ? static_cast<char>(letter - 'A' + 'a') : letter;
  }
  return name;
}

std::vector<std::string> set_controls(
    const V4l2Node& node, const std::vector<std::pair<std::string, std::string>>& controls) {
  std::vector<std::string> warnings;
  if (controls.empty()) return warnings;
  const std::vector<Control> known = list_controls(node);
  for (const auto& [name, value] : controls)
    if (const auto reason = set_by_name(node, known, name, value))
      warnings.push_back("cannot set the control " + name + " to " + value + ": " + *reason);
  return warnings;
}

}  // namespace loopd
