#include "app/reload.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <variant>

namespace loopd {
namespace {

constexpr std::array<std::string_view, 7> kCameraKeys = {
    "camera.source", "camera.path",   "camera.width",   "camera.height",
    "camera.fps",    "camera.format", "camera.controls"};
constexpr std::array<std::string_view, 1> kKeysAtOnce = {"events.stats_interval_s"};

template <std::size_t N>
bool holds(const std::array<std::string_view, N>& keys, std::string_view key) {
  return std::ranges::find(keys, key) != keys.end();
}

bool equal(const ParameterRef& a, const ParameterRef& b) {
  return std::visit(
      [&b](auto* value) { return *value == *std::get<std::remove_cvref_t<decltype(value)>>(b); },
      a);
}

void assign(const ParameterRef& to, const ParameterRef& from) {
  std::visit(
      [&from](auto* value) { *value = *std::get<std::remove_cvref_t<decltype(value)>>(from); }, to);
}

std::string list_text(const std::vector<std::string>& keys) {
  std::string text;
  for (const std::string& key : keys) text += (text.empty() ? "" : ", ") + key;
  return text;
}

}  // namespace

ConfigChanges changes_between(const DaemonConfig& in_force, const DaemonConfig& wanted) {
  ConfigChanges changes;
  changes.config = in_force;
  DaemonConfig target = wanted;
  const bool stays_live = in_force.camera.live() && wanted.camera.live();
  for (const Parameter<DaemonConfig>& row : daemon_parameters()) {
    const ParameterRef now = row.ref(changes.config);
    const ParameterRef then = row.ref(target);
    if (equal(now, then)) continue;
    const bool of_camera = stays_live && holds(kCameraKeys, row.key);
    const bool at_once = holds(kKeysAtOnce, row.key);
    std::vector<std::string>& keys =
        of_camera ? changes.camera : (at_once ? changes.at_once : changes.restart);
    keys.emplace_back(row.key);
    if (of_camera || at_once) assign(now, then);
  }
  return changes;
}

std::string changes_text(const ConfigChanges& changes) {
  if (changes.none()) return "nothing has changed";
  std::string text;
  const auto add = [&text](std::string_view what, const std::vector<std::string>& keys) {
    if (keys.empty()) return;
    if (!text.empty()) text += "; ";
    text += std::string(what) + " " + list_text(keys);
  };
  add("taken over:", changes.at_once);
  add("the camera is opened again for", changes.camera);
  add("only a restart changes", changes.restart);
  return text;
}

}  // namespace loopd
