#include "index/natural_log.h"

#include <bit>
#include <cassert>
#include <cstdint>

namespace loopd {
namespace {

constexpr std::uint64_t kMantissaBits = 52;
constexpr std::uint64_t kMantissaMask = (std::uint64_t{1} << kMantissaBits) - 1;
constexpr std::uint64_t kExponentOfOne = 1023;
constexpr double kSqrt2 = 1.4142135623730951;
// ln 2 in two parts, the first short enough that exponent * kLn2High is exact.
constexpr double kLn2High = 0x1.62e42fefap-1;
constexpr double kLn2Low = 0x1.cf79abc9e3b3ap-40;

// 2 artanh(t) = 2 (t + t^3 / 3 + t^5 / 5 + ...). |t| <= 0.1716 leaves less than 2^-58 of t.
double twice_artanh(double t) {
  const double square = t * t;
  double sum = 0;
  for (int power = 21; power >= 3; power -= 2) sum = (sum + 1.0 / power) * square;
  return 2 * t + 2 * t * sum;
}

}  // namespace

double natural_log(double x) {
  const auto bits = std::bit_cast<std::uint64_t>(x);
  auto exponent = static_cast<int>(bits >> kMantissaBits) - static_cast<int>(kExponentOfOne);
  assert(exponent > -1023 && exponent < 1024);  // also refuses x <= 0: the sign bit is above
  // x = mantissa * 2^exponent with mantissa in [sqrt(1/2), sqrt(2)].
  double mantissa =
      std::bit_cast<double>((bits & kMantissaMask) | (kExponentOfOne << kMantissaBits));
  if (mantissa > kSqrt2) {
    mantissa /= 2;
    ++exponent;
  }
  const double whole = exponent;
  return whole * kLn2High + (twice_artanh((mantissa - 1) / (mantissa + 1)) + whole * kLn2Low);
}

}  // namespace loopd
