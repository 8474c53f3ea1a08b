#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace loopd {

/// Reads the text of a `times.txt`: one number a line, in nanoseconds.
///
/// Blank lines and lines that start with # are skipped. If all numbers are whole and their median
/// step is at least 100000 (a single one: if it is at least 1e14), they are nanoseconds: as seconds
/// there would be more than a day between two images. Everything else is seconds, with decimals
/// (read exactly, digits beyond the ninth are cut off) and an exponent if wanted ("2.5e-01").
/// Errors: the first line that is no such number, or out of the range of 64-bit nanoseconds.
Result<std::vector<std::int64_t>> parse_times(std::string_view text);

}  // namespace loopd
