#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/result.h"
#include "loopd/frame.h"

namespace loopd::image {

/// An 8-bit colour picture: row-major, three bytes (red, green, blue) a pixel, rows packed.
struct RgbImage {
  int width_px = 0;
  int height_px = 0;
  std::vector<std::uint8_t> data;
};

/// Writes `image` as a grey PNG with fast compression; the same pixels give the same bytes.
/// Errors: the file cannot be created or written (nothing half-written is left). Reentrant.
Status write_png(const std::filesystem::path& path, const LumaView& image);

/// The same for a colour picture.
Status write_png(const std::filesystem::path& path, const RgbImage& image);

/// Writes `image` as a grey JPEG of `quality` 1..100. Errors and thread as write_png.
Status write_jpeg(const std::filesystem::path& path, const LumaView& image, int quality);

/// Writes `bytes` to `path`, through a temporary name beside it, so that `path` is either the whole
/// new file or what it was before.
Status write_file(const std::filesystem::path& path, const void* bytes, std::size_t size);

}  // namespace loopd::image
