#include "capture/times_file.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <optional>
#include <string>

namespace loopd {
namespace {

constexpr int kNanoDigits = 9;
constexpr std::int64_t kMinStep_ns = 100'000;
constexpr std::int64_t kMinSingle_ns = 100'000'000'000'000;

std::string_view trimmed(std::string_view line) {
  constexpr std::string_view kSpace = " \t\r";
  const std::size_t first = line.find_first_not_of(kSpace);
  if (first == std::string_view::npos) return {};
  return line.substr(first, line.find_last_not_of(kSpace) - first + 1);
}

// A decimal number as digits * 10^exponent.
struct Decimal {
  bool negative = false;
  std::string digits;
  int exponent = 0;
  bool whole = true;  ///< written without point and exponent
};

std::optional<Decimal> parse_decimal(std::string_view text) {
  Decimal number;
  if (!text.empty() && (text[0] == '-' || text[0] == '+')) {
    number.negative = text[0] == '-';
    text.remove_prefix(1);
  }
  const std::size_t e = text.find_first_of("eE");
  if (e != std::string_view::npos) {
    std::string_view power = text.substr(e + 1);
    if (!power.empty() && power[0] == '+') power.remove_prefix(1);
    const char* end = power.data() + power.size();
    const auto [stop, error] = std::from_chars(power.data(), end, number.exponent);
    if (error != std::errc() || stop != end || std::abs(number.exponent) > 100) return std::nullopt;
    number.whole = false;
  }
  const std::string_view mantissa = text.substr(0, e);
  const std::size_t point = std::min(mantissa.find('.'), mantissa.size());
  number.digits = mantissa.substr(0, point);
  if (point < mantissa.size()) {
    const std::string_view fraction = mantissa.substr(point + 1);
    number.digits += fraction;
    number.exponent -= static_cast<int>(std::min<std::size_t>(fraction.size(), 1000));
    number.whole = false;
  }
  const bool valid = !number.digits.empty() && number.digits.size() <= 200 &&
                     number.digits.find_first_not_of("0123456789") == std::string::npos;
  return valid ? std::optional(number) : std::nullopt;
}

// digits * 10^(exponent + shift) as a whole number, cut towards zero; none if it does not fit.
std::optional<std::int64_t> scaled(const Decimal& number, int shift) {
  const int power = number.exponent + shift;
  std::string digits = number.digits;
  if (power >= 0)
    digits.append(static_cast<std::size_t>(power), '0');
  else
    digits.resize(digits.size() - std::min(digits.size(), static_cast<std::size_t>(-power)));
  if (digits.empty()) return 0;
  std::int64_t value = 0;
  const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc()) return std::nullopt;
  return number.negative ? -value : value;
}

bool are_nanoseconds(const std::vector<Decimal>& numbers) {
  std::vector<std::int64_t> values;
  for (const Decimal& number : numbers) {
    const auto value = scaled(number, 0);
    if (!number.whole || !value) return false;
    values.push_back(*value);
  }
  if (values.size() == 1) return values[0] >= kMinSingle_ns;
  std::vector<std::int64_t> steps;
  for (std::size_t i = 1; i < values.size(); ++i) {
    std::int64_t step = 0;
    if (__builtin_sub_overflow(values[i], values[i - 1], &step)) return false;
    steps.push_back(step);
  }
  if (steps.empty()) return false;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle >= kMinStep_ns;
}

Error line_error(std::size_t line, const std::string& problem) {
  return {"line " + std::to_string(line) + " " + problem, EINVAL};
}

}  // namespace

Result<std::vector<std::int64_t>> parse_times(std::string_view text) {
  std::vector<Decimal> numbers;
  std::vector<std::size_t> lines;
  for (std::size_t at = 0, line = 1; at < text.size(); ++line) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view content = trimmed(text.substr(at, end - at));
    at = end + 1;
    if (content.empty() || content[0] == '#') continue;
    const std::optional<Decimal> number = parse_decimal(content);
    if (!number) return line_error(line, "is not one number");
    numbers.push_back(*number);
    lines.push_back(line);
  }
  const int shift = are_nanoseconds(numbers) ? 0 : kNanoDigits;
  std::vector<std::int64_t> times;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto time = scaled(numbers[i], shift);
    if (!time) return line_error(lines[i], "is out of range");
    times.push_back(*time);
  }
  return times;
}

}  // namespace loopd
