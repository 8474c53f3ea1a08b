#include <cctype>
#include <optional>
#include <string>

#include "capture/decode_formats.h"
#include "capture/luma.h"

namespace loopd {
namespace {

struct Pnm {
  ImageSize size;
  unsigned max_value = 0;
  std::size_t channels = 1;
  std::span<const std::uint8_t> pixels;  ///< what follows the header, of any length
};

// Reads the header's numbers, which white space and comments (# to the end of the line) separate.
class Scanner {
 public:
  explicit Scanner(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  std::optional<std::uint64_t> number() {
    skip_space();
    constexpr std::uint64_t kLimit = 1'000'000'000;
    std::optional<std::uint64_t> value;
    for (; at_ < bytes_.size() && std::isdigit(bytes_[at_]) != 0; ++at_) {
      value = value.value_or(0) * 10 + static_cast<std::uint64_t>(bytes_[at_] - '0');
      if (*value > kLimit) return std::nullopt;
    }
    return value;
  }

  // The single white space that ends the header.
  bool end() { return at_ < bytes_.size() && std::isspace(bytes_[at_++]) != 0; }
  std::span<const std::uint8_t> rest() const { return bytes_.subspan(at_); }

 private:
  void skip_space() {
    bool comment = false;
    for (; at_ < bytes_.size(); ++at_) {
      if (bytes_[at_] == '#') comment = true;
      if (bytes_[at_] == '\n') comment = false;
      if (!comment && std::isspace(bytes_[at_]) == 0) return;
    }
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
};

Result<Pnm> parse(std::span<const std::uint8_t> bytes) {
  Pnm pnm;
  pnm.channels = bytes[1] == '6' ? 3 : 1;
  Scanner scanner(bytes.subspan(2));
  const auto width = scanner.number();
  const auto height = scanner.number();
  const auto max_value = scanner.number();
  if (!width || !height || !max_value || !scanner.end())
    return damaged("the PGM/PPM header is damaged or incomplete");
  if (*max_value < 1 || *max_value > 65535)
    return damaged("its PGM/PPM header gives the maximum value " + std::to_string(*max_value) +
                   ", which must be 1 to 65535");
  const Result<ImageSize> size = checked_size(*width, *height);
  if (!size.ok()) return size.error();
  pnm.size = size.value();
  pnm.max_value = static_cast<unsigned>(*max_value);
  pnm.pixels = scanner.rest();
  return pnm;
}

// A sample of `bytes_per_sample` bytes, most significant first, brought to 0 .. 255.
unsigned sample(const std::uint8_t* at, unsigned max_value) {
  if (max_value == 255) return at[0];
  if (max_value == 65535) return at[0];
  unsigned value = at[0];
  if (max_value > 255) value = value << 8 | at[1];
  value = value < max_value ? value : max_value;
  return (value * 255 + max_value / 2) / max_value;
}

}  // namespace

Result<ImageSize> pnm_size(std::span<const std::uint8_t> bytes) {
  const Result<Pnm> pnm = parse(bytes);
  if (!pnm.ok()) return pnm.error();
  return pnm.value().size;
}

Status decode_pnm(std::span<const std::uint8_t> bytes, std::span<std::uint8_t> luma) {
  const Result<Pnm> parsed = parse(bytes);
  if (!parsed.ok()) return parsed.error();
  const Pnm& pnm = parsed.value();
  const std::size_t step = pnm.max_value > 255 ? 2 : 1;
  const std::size_t needed = pnm.size.pixels() * pnm.channels * step;
  if (pnm.pixels.size() < needed)
    return damaged("the PGM/PPM data ends early, after " + std::to_string(pnm.pixels.size()) +
                   " of " + std::to_string(needed) + " bytes");
  const std::uint8_t* in = pnm.pixels.data();
  for (std::size_t i = 0; i < pnm.size.pixels(); ++i, in += pnm.channels * step) {
    const unsigned first = sample(in, pnm.max_value);
    luma[i] = pnm.channels == 1 ? static_cast<std::uint8_t>(first)
                                : luma_from_rgb(first, sample(in + step, pnm.max_value),
                                                sample(in + 2 * step, pnm.max_value));
  }
  return Nothing{};
}

}  // namespace loopd
