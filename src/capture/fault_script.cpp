#include "capture/fault_script.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <variant>

namespace loopd {
namespace {

constexpr std::uint64_t kMaxCount = 1'000'000;
constexpr double kMaxDuration_ns = 1e6 * 3600e9;

struct KindName {
  std::string_view name;
  FaultKind kind;
};
constexpr std::array<KindName, 5> kKinds{{{"stall", FaultKind::kStall},
                                          {"drop", FaultKind::kDrop},
                                          {"corrupt", FaultKind::kCorrupt},
                                          {"unplug", FaultKind::kUnplug},
                                          {"jump", FaultKind::kJump}}};

struct Unit {
  std::string_view name;
  double ns;
};
constexpr std::array<Unit, 4> kUnits{{{"ms", 1e6}, {"s", 1e9}, {"min", 60e9}, {"h", 3600e9}}};

std::optional<FaultKind> kind_of(std::string_view name) {
  for (const KindName& kind : kKinds)
    if (kind.name == name) return kind.kind;
  return std::nullopt;
}

std::optional<std::uint64_t> parse_whole(std::string_view text) {
  std::uint64_t value = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

std::optional<std::int64_t> parse_duration(std::string_view text, bool may_be_negative) {
  double sign = 1;
  if (may_be_negative && !text.empty() && (text[0] == '+' || text[0] == '-')) {
    sign = text[0] == '-' ? -1 : 1;
    text.remove_prefix(1);
  }
  double value = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value, std::chars_format::fixed);
  if (error != std::errc() || !(value >= 0)) return std::nullopt;
  const std::string_view name(stop, static_cast<std::size_t>(end - stop));
  for (const Unit& unit : kUnits)
    if (unit.name == name && value * unit.ns <= kMaxDuration_ns)
      return static_cast<std::int64_t>(std::llround(sign * value * unit.ns));
  return std::nullopt;
}

bool has_duration(FaultKind kind) {
  return kind == FaultKind::kStall || kind == FaultKind::kUnplug || kind == FaultKind::kJump;
}

// A fault, or what is wrong with it.
std::variant<Fault, std::string> parse_fault(std::string_view text) {
  const std::string quoted = '"' + std::string(text) + '"';
  const std::size_t at = text.find('@');
  const std::optional<FaultKind> kind = kind_of(text.substr(0, at));
  if (at == std::string_view::npos || !kind)
    return quoted + " is not stall@, drop@, corrupt@, unplug@ or jump@ and a frame number";
  const std::string_view rest = text.substr(at + 1);
  const std::size_t colon = rest.find(':');
  const std::optional<std::uint64_t> frame = parse_whole(rest.substr(0, colon));
  if (!frame) return quoted + " needs a frame number after the @";
  const bool has_argument = colon != std::string_view::npos;
  const std::string_view argument = has_argument ? rest.substr(colon + 1) : std::string_view("1");

  Fault fault{*kind, *frame, 0, 0};
  if (has_duration(*kind)) {
    const auto duration = parse_duration(argument, *kind == FaultKind::kJump);
    if (!duration || !has_argument)
      return quoted + " needs a duration such as :500ms, :2s, :5min or :1h (at most 1000000h)";
    fault.duration_ns = *duration;
  } else {
    const auto count = parse_whole(argument);
    if (!count || *count < 1 || *count > kMaxCount)
      return quoted + " needs a count of 1 to 1000000 after the colon, or no colon";
    fault.count = *count;
  }
  return fault;
}

std::vector<std::string_view> split(std::string_view script) {
  constexpr std::string_view kSeparators = " ,\t\r\n";
  std::vector<std::string_view> words;
  for (std::size_t at = 0; at < script.size();) {
    const std::size_t end = std::min(script.find_first_of(kSeparators, at), script.size());
    if (end > at) words.push_back(script.substr(at, end - at));
    at = end + 1;
  }
  return words;
}

Error mistakes_error(const std::vector<std::string>& mistakes) {
  std::string message = "the fault script has " + std::to_string(mistakes.size()) +
                        (mistakes.size() == 1 ? " mistake" : " mistakes");
  for (std::size_t i = 0; i < mistakes.size(); ++i) message += (i == 0 ? ": " : "; ") + mistakes[i];
  return {std::move(message), EINVAL};
}

bool covers(const Fault& fault, FaultKind kind, std::uint64_t frame) {
  return fault.kind == kind && frame >= fault.frame && frame - fault.frame < fault.count;
}

}  // namespace

std::int64_t saturating_add(std::int64_t a, std::int64_t b) {
  std::int64_t sum = 0;
  if (!__builtin_add_overflow(a, b, &sum)) return sum;
  return b < 0 ? std::numeric_limits<std::int64_t>::min()
               : std::numeric_limits<std::int64_t>::max();
}

Result<FaultScript> FaultScript::parse(std::string_view script) {
  FaultScript result;
  std::vector<std::string> mistakes;
  for (const std::string_view word : split(script)) {
    std::variant<Fault, std::string> parsed = parse_fault(word);
    if (const Fault* fault = std::get_if<Fault>(&parsed))
      result.faults_.push_back(*fault);
    else
      mistakes.push_back(std::get<std::string>(std::move(parsed)));
  }
  if (!mistakes.empty()) return mistakes_error(mistakes);
  std::stable_sort(result.faults_.begin(), result.faults_.end(),
                   [](const Fault& a, const Fault& b) { return a.frame < b.frame; });
  return result;
}

void FaultScript::discard_before(std::uint64_t frame) {
  std::erase_if(faults_, [frame](const Fault& fault) { return fault.frame < frame; });
  next_break_ = 0;
}

const Fault* FaultScript::take_break(std::uint64_t frame) {
  for (; next_break_ < faults_.size() && faults_[next_break_].frame <= frame;) {
    const Fault& fault = faults_[next_break_++];
    if (fault.kind == FaultKind::kStall || fault.kind == FaultKind::kUnplug) return &fault;
  }
  return nullptr;
}

std::uint64_t FaultScript::after_drops(std::uint64_t frame) const {
  for (const Fault& fault : faults_)
    if (covers(fault, FaultKind::kDrop, frame)) frame = fault.frame + fault.count;
  return frame;
}

bool FaultScript::corrupts(std::uint64_t frame) const {
  return std::any_of(faults_.begin(), faults_.end(), [frame](const Fault& fault) {
    return covers(fault, FaultKind::kCorrupt, frame);
  });
}

std::int64_t FaultScript::jump_ns(std::uint64_t frame) const {
  std::int64_t sum = 0;
  for (const Fault& fault : faults_)
    if (fault.kind == FaultKind::kJump && fault.frame <= frame)
      sum = saturating_add(sum, fault.duration_ns);
  return sum;
}

}  // namespace loopd
