#include <png.h>

#include <array>
#include <csetjmp>
#include <cstring>
#include <string>
#include <vector>

#include "capture/decode_formats.h"
#include "capture/luma.h"

namespace loopd {
namespace {

// Owns what libpng needs. libpng reports errors by longjmp, so every call to it is in a function
// whose frame holds nothing with a destructor, below a setjmp; the rest lives here.
class PngReader {
 public:
  explicit PngReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, &PngReader::fail, &PngReader::warn);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
    if (info_ == nullptr) {
      png_destroy_read_struct(&png_, nullptr, nullptr);
      throw std::bad_alloc();
    }
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  Status decode(std::span<std::uint8_t> luma) {
    if (!read_header()) return failure();
    scratch_.resize(scratch_bytes());
    if (!read_pixels(luma.data())) return failure();
    return Nothing{};
  }

 private:
  static void fail(png_structp png, png_const_charp message) {
    auto* self = static_cast<PngReader*>(png_get_error_ptr(png));
    std::strncpy(self->message_.data(), message, self->message_.size() - 1);
    longjmp(self->jump_, 1);
  }
  static void warn(png_structp, png_const_charp) {}
  static void read(png_structp png, png_bytep out, std::size_t length) {
    auto* self = static_cast<PngReader*>(png_get_io_ptr(png));
    if (length > self->bytes_.size() - self->at_) png_error(png, "the data ends early");
    std::memcpy(out, self->bytes_.data() + self->at_, length);
    self->at_ += length;
  }

  // Asks libpng for rows of plain 8-bit grey or RGB, whatever the file holds.
  bool read_header() {
    if (setjmp(jump_) != 0) return false;
    png_set_read_fn(png_, this, &PngReader::read);
    png_set_user_limits(png_, 65535, 65535);
    png_set_chunk_malloc_max(png_, 4 << 20);
    png_set_chunk_cache_max(png_, 16);
    png_read_info(png_, info_);
    png_set_strip_16(png_);
    png_set_palette_to_rgb(png_);
    png_set_expand_gray_1_2_4_to_8(png_);
    png_set_strip_alpha(png_);
    passes_ = png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    width_ = png_get_image_width(png_, info_);
    height_ = png_get_image_height(png_, info_);
    channels_ = png_get_channels(png_, info_);
    if (channels_ != 1 && channels_ != 3) png_error(png_, "unexpected channels");
    return true;
  }

  // Grey rows go straight to their place; RGB needs one row, or all if rows come in passes.
  std::size_t scratch_bytes() const {
    if (channels_ == 1) return 0;
    return std::size_t{width_} * channels_ * (passes_ > 1 ? height_ : 1);
  }

  std::uint8_t* row(std::uint8_t* luma, std::size_t y) {
    if (channels_ == 1) return luma + y * width_;
    return scratch_.data() + (passes_ > 1 ? y * width_ * channels_ : 0);
  }

  bool read_pixels(std::uint8_t* luma) {
    if (setjmp(jump_) != 0) return false;
    for (int pass = 0; pass < passes_; ++pass)
      for (std::size_t y = 0; y < height_; ++y) {
        png_read_row(png_, row(luma, y), nullptr);
        if (pass + 1 == passes_ && channels_ == 3) to_luma(row(luma, y), luma + y * width_);
      }
    png_read_end(png_, nullptr);
    return true;
  }

  void to_luma(const std::uint8_t* rgb, std::uint8_t* luma) const {
    for (std::size_t x = 0; x < width_; ++x, rgb += 3)
      luma[x] = luma_from_rgb(rgb[0], rgb[1], rgb[2]);
  }

  Error failure() const {
    return damaged("the PNG data is damaged or ends early (" + std::string(message_.data()) + ")");
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::jmp_buf jump_{};
  std::array<char, 128> message_{};
  std::size_t width_ = 0;
  std::size_t height_ = 0;
  std::size_t channels_ = 0;
  int passes_ = 0;
  std::vector<std::uint8_t> scratch_;
};

std::uint32_t big_endian(std::span<const std::uint8_t> bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | bytes[at + i];
  return value;
}

}  // namespace

Result<ImageSize> png_size(std::span<const std::uint8_t> bytes) {
  // Signature (8), then the IHDR chunk: length (4), "IHDR", width (4), height (4).
  if (bytes.size() < 24 || std::memcmp(bytes.data() + 12, "IHDR", 4) != 0)
    return damaged("the PNG header is damaged or incomplete");
  return checked_size(big_endian(bytes, 16), big_endian(bytes, 20));
}

Status decode_png(std::span<const std::uint8_t> bytes, std::span<std::uint8_t> luma) {
  return PngReader(bytes).decode(luma);
}

}  // namespace loopd
