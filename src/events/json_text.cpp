#include "events/json_text.h"

#include <algorithm>

namespace loopd::json_text {

namespace {

/// A request needs three levels; a parser that is handed more is being tested.
constexpr int kMaxDepth = 16;
constexpr std::size_t kMaxQuotedBytes = 40;

ReadRequest refuse(std::string why) { return {std::nullopt, {}, std::move(why)}; }

/// Deepest nesting of brackets outside strings.
int nesting_depth(std::string_view text) {
  int depth = 0, deepest = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
      continue;
    }
    if (c == '"') in_string = true;
    if (c == '[' || c == '{') deepest = std::max(deepest, ++depth);
    if (c == ']' || c == '}') --depth;
  }
  return deepest;
}

ReadRequest with_op(Json json, std::string_view example_op) {
  const std::string example = R"({"op":")" + std::string(example_op) + R"("})";
  if (!json.is_object()) return refuse("a request must be an object like " + example);
  const auto op = json.find("op");
  if (op == json.end() || !op->is_string()) {
    return refuse("a request must name its \"op\", like " + example);
  }
  std::string name = op->get<std::string>();
  return {std::move(json), std::move(name), {}};
}

}  // namespace

std::string quote(const std::string& text) {
  std::string quoted("\"");
  quoted.append(text, 0, kMaxQuotedBytes);
  quoted += text.size() > kMaxQuotedBytes ? "...\"" : "\"";
  return quoted;
}

ReadRequest read_request(std::string_view text, std::string_view example_op) {
  if (nesting_depth(text) > kMaxDepth) {
    return refuse("not a request: nested deeper than " + std::to_string(kMaxDepth) + " levels");
  }
  try {
    return with_op(Json::parse(text), example_op);
  } catch (const Json::parse_error& error) {
    return refuse("not JSON: the mistake is near byte " + std::to_string(error.byte) +
                  " of the line");
  } catch (const Json::exception&) {  // a number beyond double
    return refuse("not JSON: a number is out of range");
  }
}

}  // namespace loopd::json_text
