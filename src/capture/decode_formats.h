#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/result.h"
#include "capture/decode.h"

namespace loopd {

// The readers behind ImageDecoder, one a format. All take a whole file; `decode_*` write packed
// luma into `luma`, which the caller has made large enough for the size in the same file's header.

Error damaged(std::string cause);
Error unsupported(std::string cause);

/// A size between 1x1 and 65535x65535 or an error; says nothing about the pixel limit.
Result<ImageSize> checked_size(std::uint64_t width, std::uint64_t height);

Result<ImageSize> png_size(std::span<const std::uint8_t> bytes);
Status decode_png(std::span<const std::uint8_t> bytes, std::span<std::uint8_t> luma);

Result<ImageSize> pnm_size(std::span<const std::uint8_t> bytes);
Status decode_pnm(std::span<const std::uint8_t> bytes, std::span<std::uint8_t> luma);

}  // namespace loopd
