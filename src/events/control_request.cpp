#include "events/control_request.h"

#include <algorithm>
#include <array>
#include <utility>

#include "events/json_text.h"

namespace loopd {

namespace {

using json_text::Json;
using json_text::quote;

constexpr std::array<std::string_view, 7> kOpNames = {"status", "pause",  "resume",     "reset",
                                                      "reload", "record", "stop_record"};
constexpr std::uint64_t kBytesPerMib = 1024 * 1024;

std::string known_ops() {
  std::string names;
  for (std::string_view name : kOpNames) names += (names.empty() ? "" : ", ") + std::string(name);
  return names;
}

/// The violated rule, or empty with `limits` filled.
std::string read_limits(const Json& json, RecordLimits& limits) {
  if (const auto it = json.find("seconds"); it != json.end()) {
    const double seconds = it->is_number() ? it->get<double>() : 0;
    if (!(seconds > 0 && seconds <= RecordLimits::kMaxSeconds)) {
      return "\"seconds\" must be a number above 0 and at most 86400";
    }
    limits.seconds = seconds;
  }
  if (const auto it = json.find("max_mib"); it != json.end()) {
    const std::uint64_t mib = it->is_number_unsigned() ? it->get<std::uint64_t>() : 0;
    if (mib == 0 || mib > RecordLimits::kMaxMib) {
      return "\"max_mib\" must be a whole number from 1 to 1048576";
    }
    limits.max_bytes = mib * kBytesPerMib;
  }
  return {};
}

void set_field(Json& json, const ControlField& field) {
  if (const double* number = std::get_if<double>(&field.value)) {
    json_text::set_finite(json, field.name, *number);
  } else {
    std::visit([&](const auto& value) { json[field.name] = value; }, field.value);
  }
}

Json start(std::string_view record_class, std::string_view op) {
  Json json{{"class", record_class}};
  if (!op.empty()) json["op"] = op;
  return json;
}

}  // namespace

std::string_view control_op_name(ControlOp op) { return kOpNames[static_cast<std::size_t>(op)]; }

ParsedControl parse_control(std::string_view line) {
  ParsedControl parsed;
  json_text::ReadRequest read = json_text::read_request(line, "status");
  if (!read.json) {
    parsed.error = std::move(read.error);
    return parsed;
  }
  const auto it = std::find(kOpNames.begin(), kOpNames.end(), read.op);
  if (it == kOpNames.end()) {
    parsed.error = "unknown op " + quote(read.op) + "; known are: " + known_ops();
    return parsed;
  }
  parsed.name = read.op;
  const auto op = static_cast<ControlOp>(it - kOpNames.begin());
  if (op == ControlOp::kRecord) parsed.error = read_limits(*read.json, parsed.limits);
  if (parsed.error.empty()) parsed.op = op;
  return parsed;
}

std::string control_text(std::string_view record_class, std::string_view op,
                         const ControlFields& fields) {
  Json json = start(record_class, op);
  for (const ControlField& field : fields) set_field(json, field);
  return json_text::dump(json);
}

std::string control_error_text(std::string_view op, std::string_view message) {
  Json json = start("error", op);
  json["message"] = message;
  return json_text::dump(json);
}

std::string control_request_text(ControlOp op, const RecordLimits& limits) {
  Json json{{"op", control_op_name(op)}};
  if (op == ControlOp::kRecord) {
    json["seconds"] = limits.seconds;
    json["max_mib"] = limits.max_bytes / kBytesPerMib;
  }
  return json_text::dump(json);
}

}  // namespace loopd
