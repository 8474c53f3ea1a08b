#include <algorithm>
#include <array>
#include <cstdint>

#include "events/json_text.h"
#include "events/records.h"

namespace loopd {

namespace {

using json_text::Json;
using json_text::quote;

constexpr std::array<std::string_view, kRecordClasses> kClassNames = {"loop", "candidate", "state",
                                                                      "stats"};
constexpr std::string_view kKnownClasses = "loop, candidate, state, stats";
ParsedRequest refuse(std::string why) { return {std::nullopt, std::move(why)}; }

/// The violated rule, or empty with `classes` filled.
std::string read_classes(const Json& json, ClassSet& classes) {
  if (!json.is_array()) return "\"classes\" must be an array of class names";
  classes = ClassSet();
  for (const Json& item : json) {
    if (!item.is_string()) return "\"classes\" must be an array of class names";
    const std::string& name = item.get_ref<const std::string&>();
    const std::optional<RecordClass> record_class = record_class_from_name(name);
    if (!record_class) {
      return "unknown class " + quote(name) + "; known are: " + std::string(kKnownClasses);
    }
    classes.add(*record_class);
  }
  return {};
}

std::string read_since(const Json& json, std::optional<Since>& since) {
  constexpr const char* kRule = "\"since\" must be {\"epoch\": text, \"seq\": whole number >= 0}";
  if (!json.is_object()) return kRule;
  const auto epoch = json.find("epoch");
  const auto seq = json.find("seq");
  if (epoch == json.end() || !epoch->is_string()) return kRule;
  if (seq == json.end() || !seq->is_number_unsigned()) return kRule;
  since = Since{epoch->get<std::string>(), seq->get<std::uint64_t>()};
  return {};
}

std::string read_pairs(const Json& json, bool& pairs) {
  if (!json.is_boolean()) return "\"pairs\" must be true or false";
  pairs = json.get<bool>();
  return {};
}

ParsedRequest read_watch(const Json& json) {
  WatchRequest request;
  std::string error;
  if (const auto it = json.find("classes"); it != json.end()) {
    error = read_classes(*it, request.classes);
  }
  if (const auto it = json.find("pairs"); error.empty() && it != json.end()) {
    error = read_pairs(*it, request.pairs);
  }
  if (const auto it = json.find("since"); error.empty() && it != json.end()) {
    error = read_since(*it, request.since);
  }
  if (!error.empty()) return refuse(std::move(error));
  return {std::move(request), {}};
}

}  // namespace

std::string_view record_class_name(RecordClass record_class) {
  return kClassNames[static_cast<std::size_t>(record_class)];
}

std::optional<RecordClass> record_class_from_name(std::string_view name) {
  const auto it = std::find(kClassNames.begin(), kClassNames.end(), name);
  if (it == kClassNames.end()) return std::nullopt;
  return static_cast<RecordClass>(it - kClassNames.begin());
}

std::string request_text(const WatchRequest& request) {
  Json json{{"op", "watch"}};
  json["classes"] = Json::array();
  for (std::string_view name : kClassNames) {
    if (request.classes.has(*record_class_from_name(name))) json["classes"].push_back(name);
  }
  json["pairs"] = request.pairs;
  if (request.since) {
    json["since"] = {{"epoch", request.since->epoch}, {"seq", request.since->seq}};
  }
  return json_text::dump(json);
}

ParsedRequest parse_request(std::string_view line) {
  json_text::ReadRequest read = json_text::read_request(line, "watch");
  if (!read.json) return refuse(std::move(read.error));
  if (read.op != "watch") return refuse("unknown op " + quote(read.op) + "; known is: watch");
  return read_watch(*read.json);
}

}  // namespace loopd
