#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "base/result.h"

namespace loopd {

enum class ImageFormat : std::uint8_t { kJpeg, kPng, kPnm };

/// Which format the first bytes of a file announce; none if it is no image we can read.
std::optional<ImageFormat> image_format(std::span<const std::uint8_t> bytes);

struct ImageSize {
  int width_px = 0;
  int height_px = 0;
  std::size_t pixels() const {
    return static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  }
};

/// Decodes whole image files in memory to 8-bit luma, rows packed. The format is found by content:
///  - JPEG (baseline and progressive): the luma channel as it is stored, colour is never decoded.
///    Damage that the JPEG library can only paper over (data that ends early, broken codes) is an
///    error; surplus bytes before a marker, which many cameras write, are not.
///  - PNG, every kind: colour and palette by luma_from_rgb, transparency ignored (the stored colour
///    counts), 16 bits by the high byte, gamma and colour profiles ignored.
///  - PGM and PPM, binary (P5, P6): values above 8 bits by v * 255 / maxval rounded, but by the
///  high
///    byte for maxval 65535; colour by luma_from_rgb.
///
/// Errors are one clause without the file's name ("the JPEG data ends early"), with a code:
/// EBADMSG damaged, EFBIG larger than `max_pixels`, ENOTSUP not a format that is read here.
/// Every size is checked before memory is taken for it; working memory is at most 8 bytes a pixel
/// beside the JPEG library's own.
///
/// Thread: one caller at a time; keeps its decoder and scratch memory between calls.
class ImageDecoder {
 public:
  /// Precondition: max_pixels >= 1.
  explicit ImageDecoder(std::size_t max_pixels);
  ~ImageDecoder();
  ImageDecoder(const ImageDecoder&) = delete;
  ImageDecoder& operator=(const ImageDecoder&) = delete;

  /// Width and height by the header alone; refuses what decode() would refuse for its header.
  Result<ImageSize> size(std::span<const std::uint8_t> bytes);

  /// Decodes into `luma`, which must hold size(bytes).pixels() bytes. On an error `luma` holds
  /// anything.
  Result<ImageSize> decode(std::span<const std::uint8_t> bytes, std::span<std::uint8_t> luma);

 private:
  class Jpeg;
  const std::size_t max_pixels_;
  std::unique_ptr<Jpeg> jpeg_;
};

}  // namespace loopd
