#include "images.h"

#include <algorithm>
#include <cassert>

#include "capture/decode.h"
#include "capture/read_file.h"

namespace loopd::vm {
namespace {

constexpr std::size_t kMaxBytes = 64U << 20;
constexpr std::size_t kMaxPixels = 1U << 24;
constexpr std::uint8_t kNoColour = 128;

}  // namespace

Result<std::vector<std::filesystem::path>> list_files(const std::filesystem::path& folder,
                                                      const std::string& extension) {
  std::error_code error;
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (entry.path().extension() == extension) files.push_back(entry.path());
  }
  if (error) return errno_error("cannot list " + folder.string(), error.value());
  if (files.empty()) return Error{"no *" + extension + " in " + folder.string()};
  std::sort(files.begin(), files.end());
  return files;
}

Result<std::vector<std::uint8_t>> read_bytes(const std::filesystem::path& path) {
  std::vector<std::uint8_t> bytes;
  const Status status = read_regular_file(path.string(), kMaxBytes, bytes);
  if (!status) return Error{"cannot read " + path.string() + ": " + status.error().message};
  return bytes;
}

Result<LumaImage> read_image(const std::filesystem::path& path) {
  const auto bytes = read_bytes(path);
  if (!bytes) return bytes.error();
  ImageDecoder decoder(kMaxPixels);
  const auto size = decoder.size(bytes.value());
  if (!size) return Error{path.string() + ": " + size.error().message, size.error().code};
  LumaImage image{size.value().width_px, size.value().height_px, {}};
  image.data.resize(size.value().pixels());
  const auto decoded = decoder.decode(bytes.value(), image.data);
  if (!decoded) return Error{path.string() + ": " + decoded.error().message, decoded.error().code};
  return image;
}

LumaImage halved(const LumaImage& image) {
  LumaImage half{image.width_px / 2, image.height_px / 2, {}};
  half.data.reserve(static_cast<std::size_t>(half.width_px) *
                    static_cast<std::size_t>(half.height_px));
  for (int y = 0; y < half.height_px; ++y) {
    const std::uint8_t* row = image.data.data() + std::ptrdiff_t{2} * y * image.width_px;
    const std::uint8_t* next = row + image.width_px;
    for (int x = 0; x < half.width_px; ++x, row += 2, next += 2) {
      half.data.push_back(static_cast<std::uint8_t>((row[0] + row[1] + next[0] + next[1] + 2) / 4));
    }
  }
  return half;
}

void pack_yuyv(const LumaView& image, std::span<std::uint8_t> yuyv) {
  assert(yuyv.size() >=
         2 * static_cast<std::size_t>(image.width_px) * static_cast<std::size_t>(image.height_px));
  std::uint8_t* to = yuyv.data();
  for (int y = 0; y < image.height_px; ++y) {
    const std::uint8_t* from = image.data + std::ptrdiff_t{y} * image.stride_bytes;
    for (int x = 0; x < image.width_px; ++x) {
      *to++ = from[x];
      *to++ = kNoColour;
    }
  }
}

}  // namespace loopd::vm
