#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "loopd/frame.h"

namespace loopd::vm {

/// An 8-bit luma image, rows packed.
struct LumaImage {
  int width_px = 0;
  int height_px = 0;
  std::vector<std::uint8_t> data;

  LumaView view() const { return {data.data(), width_px, height_px, width_px}; }
};

/// The files of `folder` that end in `extension` (".pgm"), sorted by name. Error: none there.
Result<std::vector<std::filesystem::path>> list_files(const std::filesystem::path& folder,
                                                      const std::string& extension);

/// The bytes of a file of at most 64 MiB.
Result<std::vector<std::uint8_t>> read_bytes(const std::filesystem::path& path);

/// Decodes a JPEG, PNG or PNM file.
Result<LumaImage> read_image(const std::filesystem::path& path);

/// Half the width and height, each pixel the mean of four, rounded.
LumaImage halved(const LumaImage& image);

/// Packs luma as YUYV (two bytes a pixel) without colour. `yuyv` holds at least twice the pixels.
void pack_yuyv(const LumaView& image, std::span<std::uint8_t> yuyv);

}  // namespace loopd::vm
