#include "image/image_write.h"

#include <fcntl.h>
#include <png.h>
#include <sys/stat.h>
#include <turbojpeg.h>
#include <unistd.h>
#include <zlib.h>

#include <cerrno>
#include <csetjmp>
#include <cstring>
#include <memory>
#include <string>

namespace loopd::image {
namespace {

void append_bytes(png_structp png, png_bytep bytes, png_size_t size) {
  auto* out = static_cast<std::vector<std::uint8_t>*>(png_get_io_ptr(png));
  out->insert(out->end(), bytes, bytes + size);
}

void no_flush(png_structp) {}

struct PngWriter {
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  PngWriter() = default;
  PngWriter(const PngWriter&) = delete;
  PngWriter& operator=(const PngWriter&) = delete;
  ~PngWriter() { png_destroy_write_struct(&png, &info); }
};

/// False if libpng refused. Rows lie `stride` bytes apart.
bool encode_png(const std::uint8_t* data, int width, int height, std::size_t stride, int colour,
                std::vector<std::uint8_t>& out) {
  PngWriter writer;
  if (writer.info == nullptr || setjmp(png_jmpbuf(writer.png)) != 0) return false;
  png_set_write_fn(writer.png, &out, append_bytes, no_flush);
  png_set_IHDR(writer.png, writer.info, static_cast<png_uint_32>(width),
               static_cast<png_uint_32>(height), 8, colour, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_compression_level(writer.png, 1);
  png_set_filter(writer.png, 0, PNG_FILTER_SUB);
  png_write_info(writer.png, writer.info);
  for (int y = 0; y < height; ++y) {
    png_write_row(writer.png, data + static_cast<std::size_t>(y) * stride);
  }
  png_write_end(writer.png, writer.info);
  return true;
}

/// Closes and, unless kept, removes the file.
struct PendingFile {
  int fd = -1;
  std::string path;
  bool keep = false;
  PendingFile(int descriptor, std::string name) : fd(descriptor), path(std::move(name)) {}
  PendingFile(const PendingFile&) = delete;
  PendingFile& operator=(const PendingFile&) = delete;
  ~PendingFile() {
    if (fd >= 0) ::close(fd);
    if (fd >= 0 && !keep) ::unlink(path.c_str());
  }
};

bool write_all(int fd, const char* bytes, std::size_t size) {
  while (size > 0) {
    const ssize_t written = ::write(fd, bytes, size);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    bytes += written;
    size -= static_cast<std::size_t>(written);
  }
  return true;
}

}  // namespace

Status write_file(const std::filesystem::path& path, const void* bytes, std::size_t size) {
  const std::string temporary = path.string() + ".part";
  PendingFile file(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666),
                   temporary);
  if (file.fd < 0) return errno_error("cannot create " + temporary, errno);
  if (!write_all(file.fd, static_cast<const char*>(bytes), size)) {
    return errno_error("cannot write " + temporary, errno);
  }
  if (::rename(temporary.c_str(), path.c_str()) != 0) {
    return errno_error("cannot rename " + temporary + " to " + path.string(), errno);
  }
  file.keep = true;
  return Nothing{};
}

Status write_png(const std::filesystem::path& path, const LumaView& image) {
  std::vector<std::uint8_t> out;
  if (!encode_png(image.data, image.width_px, image.height_px,
                  static_cast<std::size_t>(image.stride_bytes), PNG_COLOR_TYPE_GRAY, out)) {
    return Error{"cannot encode " + path.string() + " as PNG: libpng refused the image", 0};
  }
  return write_file(path, out.data(), out.size());
}

Status write_png(const std::filesystem::path& path, const RgbImage& image) {
  std::vector<std::uint8_t> out;
  if (!encode_png(image.data.data(), image.width_px, image.height_px,
                  static_cast<std::size_t>(image.width_px) * 3, PNG_COLOR_TYPE_RGB, out)) {
    return Error{"cannot encode " + path.string() + " as PNG: libpng refused the image", 0};
  }
  return write_file(path, out.data(), out.size());
}

Status write_jpeg(const std::filesystem::path& path, const LumaView& image, int quality) {
  const std::unique_ptr<void, int (*)(tjhandle)> handle(tjInitCompress(), tjDestroy);
  unsigned char* raw = nullptr;
  unsigned long size = 0;
  const bool encoded =
      handle != nullptr &&
      tjCompress2(handle.get(), image.data, image.width_px, image.stride_bytes, image.height_px,
                  TJPF_GRAY, &raw, &size, TJSAMP_GRAY, quality, TJFLAG_ACCURATEDCT) == 0;
  const std::unique_ptr<unsigned char, void (*)(unsigned char*)> owner(raw, tjFree);
  if (!encoded) {
    return Error{"cannot encode " + path.string() + " as JPEG: " + tjGetErrorStr2(handle.get()), 0};
  }
  return write_file(path, raw, size);
}

}  // namespace loopd::image
