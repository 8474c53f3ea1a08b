#pragma once

#include <png.h>
#include <turbojpeg.h>

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace loopd::testing {

// Image files made in memory, for tests; a program that uses them links turbojpeg and libpng.

/// Samples of an image, row by row, `channels` to a pixel.
struct Samples {
  int width = 0;
  int height = 0;
  int channels = 1;
  std::vector<std::uint8_t> data;
};

/// A smooth, asymmetric picture that differs for each `seed`, so that JPEG keeps it nearly as it
/// is.
inline Samples smooth_image(int width, int height, int channels = 1, int seed = 0) {
  Samples image{width, height, channels, {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < channels; ++c)
        image.data.push_back(static_cast<std::uint8_t>(
            (x * 96 / width + y * 64 / height + 40 * c + 7 * seed) % 256));
  return image;
}

inline std::string pgm_file(const Samples& image) {
  const std::string header = (image.channels == 3 ? "P6\n" : "P5\n") + std::to_string(image.width) +
                             " " + std::to_string(image.height) + "\n255\n";
  return header + std::string(image.data.begin(), image.data.end());
}

/// A JPEG at quality 95; subsampling 4:4:4.
inline std::string jpeg_file(const Samples& image, bool progressive = false) {
  tjhandle handle = tjInitCompress();
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  const int format = image.channels == 3 ? TJPF_RGB : TJPF_GRAY;
  const int sampling = image.channels == 3 ? TJSAMP_444 : TJSAMP_GRAY;
  const int failed = tjCompress2(handle, image.data.data(), image.width, 0, image.height, format,
                                 &bytes, &size, sampling, 95, progressive ? TJFLAG_PROGRESSIVE : 0);
  std::string file(reinterpret_cast<char*>(bytes), size);
  tjFree(bytes);
  tjDestroy(handle);
  if (failed != 0) throw std::runtime_error("cannot make a JPEG");
  return file;
}

/// What a PNG is to be: `rows` as in the file, most significant byte or bit first.
struct PngKind {
  int bit_depth = 8;
  int color_type = PNG_COLOR_TYPE_GRAY;
  bool interlaced = false;
  std::vector<png_color> palette;
  bool transparent = false;  ///< writes a tRNS chunk (palette: entry 0; grey: value 0)
};

inline std::string png_file(int width, int height, const PngKind& kind,
                            const std::vector<std::vector<std::uint8_t>>& rows) {
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  std::string file;
  png_set_write_fn(
      png, &file,
      [](png_structp p, png_bytep data, std::size_t length) {
        static_cast<std::string*>(png_get_io_ptr(p))
            ->append(reinterpret_cast<const char*>(data), length);
      },
      [](png_structp) {});
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height),
               kind.bit_depth, kind.color_type,
               kind.interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  if (!kind.palette.empty())
    png_set_PLTE(png, info, kind.palette.data(), static_cast<int>(kind.palette.size()));
  const png_byte alpha = 0;
  const png_color_16 clear{};
  if (kind.transparent) png_set_tRNS(png, info, &alpha, 1, &clear);
  std::vector<png_bytep> pointers;
  for (const auto& row : rows) pointers.push_back(const_cast<png_bytep>(row.data()));
  png_set_rows(png, info, pointers.data());
  png_write_png(png, info, PNG_TRANSFORM_IDENTITY, nullptr);
  png_destroy_write_struct(&png, &info);
  return file;
}

/// An 8-bit grey (1 channel) or RGB (3 channels) PNG.
inline std::string png_file(const Samples& image, bool interlaced = false) {
  const PngKind kind{
      8, image.channels == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY, interlaced, {}, false};
  std::vector<std::vector<std::uint8_t>> rows;
  const std::ptrdiff_t step = std::ptrdiff_t{image.width} * image.channels;
  for (int y = 0; y < image.height; ++y)
    rows.emplace_back(image.data.begin() + y * step, image.data.begin() + (y + 1) * step);
  return png_file(image.width, image.height, kind, rows);
}

}  // namespace loopd::testing
