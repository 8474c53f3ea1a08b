#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/result.h"

namespace loopd {

/// Reads the whole regular file `path` into `bytes`, reusing its memory.
/// A pipe, a device or a folder under that name is refused without being waited for. Errors: the
/// cause in words with its errno; EFBIG if the file holds more than `max_bytes`, however it says
/// it is long; ENOTSUP if it is not a regular file. Blocks as long as the file system does.
Status read_regular_file(const std::string& path, std::size_t max_bytes,
                         std::vector<std::uint8_t>& bytes);

}  // namespace loopd
