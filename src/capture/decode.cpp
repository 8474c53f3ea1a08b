#include "capture/decode.h"

#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <string>
#include <string_view>

#include "capture/decode_formats.h"

namespace loopd {
namespace {

bool starts_with(std::span<const std::uint8_t> bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
}

Error too_large(const ImageSize& size, std::size_t max_pixels) {
  return {"it is " + std::to_string(size.width_px) + "x" + std::to_string(size.height_px) +
              ", more than the " + std::to_string(max_pixels) +
              " pixels of camera.max_pixels; raise it or scale the images",
          EFBIG};
}

// The JPEG library reports only its first warning. Surplus bytes before a marker do no harm, but
// may have come before worse, so the file must then at least end with its end marker.
bool harmless(std::string_view warning, std::span<const std::uint8_t> bytes) {
  constexpr std::array<std::uint8_t, 2> kEndOfImage{0xff, 0xd9};
  return warning.find("extraneous bytes before marker") != std::string_view::npos &&
         std::find_end(bytes.begin(), bytes.end(), kEndOfImage.begin(), kEndOfImage.end()) !=
             bytes.end();
}

}  // namespace

Error damaged(std::string cause) { return {std::move(cause), EBADMSG}; }
Error unsupported(std::string cause) { return {std::move(cause), ENOTSUP}; }

Result<ImageSize> checked_size(std::uint64_t width, std::uint64_t height) {
  constexpr std::uint64_t kMaxSide = 65535;
  if (width >= 1 && height >= 1 && width <= kMaxSide && height <= kMaxSide)
    return ImageSize{static_cast<int>(width), static_cast<int>(height)};
  const std::string sides = std::to_string(width) + "x" + std::to_string(height);
  if (width < 1 || height < 1) return damaged("its header gives the size " + sides);
  return Error{"its header gives the size " + sides + ", and no side may exceed 65535", EFBIG};
}

std::optional<ImageFormat> image_format(std::span<const std::uint8_t> bytes) {
  using namespace std::string_view_literals;
  if (starts_with(bytes, "\xff\xd8\xff"sv)) return ImageFormat::kJpeg;
  if (starts_with(bytes, "\x89PNG\r\n\x1a\n"sv)) return ImageFormat::kPng;
  if (starts_with(bytes, "P5"sv) || starts_with(bytes, "P6"sv)) return ImageFormat::kPnm;
  return std::nullopt;
}

class ImageDecoder::Jpeg {
 public:
  Jpeg() : handle_(open()) {}

  Result<ImageSize> size(std::span<const std::uint8_t> bytes) {
    int width = 0;
    int height = 0;
    int subsampling = 0;
    int colorspace = 0;
    // A warning is no reason to stop here; a header of tables alone succeeds and leaves 0x0.
    tjDecompressHeader3(handle_.get(), bytes.data(), bytes.size(), &width, &height, &subsampling,
                        &colorspace);
    if (width < 1 || height < 1) return damaged("the JPEG header is damaged" + fail());
    if (colorspace == TJCS_CMYK || colorspace == TJCS_YCCK)
      return unsupported("it is a CMYK JPEG; convert it to grey or RGB");
    return checked_size(static_cast<std::uint64_t>(width), static_cast<std::uint64_t>(height));
  }

  Status decode(std::span<const std::uint8_t> bytes, const ImageSize& size,
                std::span<std::uint8_t> luma) {
    // TJFLAG_LIMITSCANS: a small progressive file may otherwise ask for hours of work.
    if (tjDecompress2(handle_.get(), bytes.data(), bytes.size(), luma.data(), size.width_px,
                      size.width_px, size.height_px, TJPF_GRAY, TJFLAG_LIMITSCANS) == 0)
      return Nothing{};
    if (tjGetErrorCode(handle_.get()) == TJERR_WARNING &&
        harmless(tjGetErrorStr2(handle_.get()), bytes))
      return Nothing{};
    return damaged("the JPEG data is damaged or ends early" + fail());
  }

 private:
  struct Close {
    void operator()(void* handle) const { tjDestroy(handle); }
  };
  using Handle = std::unique_ptr<void, Close>;

  static Handle open() {
    Handle handle(tjInitDecompress());
    if (handle == nullptr) throw std::bad_alloc();
    return handle;
  }

  // The library's reason. Starts afresh: after some errors, TurboJPEG 2.1 is left in the middle of
  // the damaged file and gives no size for the next, good one.
  std::string fail() {
    std::string reason = " (" + std::string(tjGetErrorStr2(handle_.get())) + ")";
    handle_ = open();
    return reason;
  }

  Handle handle_;
};

ImageDecoder::ImageDecoder(std::size_t max_pixels)
    : max_pixels_(max_pixels), jpeg_(std::make_unique<Jpeg>()) {
  assert(max_pixels >= 1);
}

ImageDecoder::~ImageDecoder() = default;

Result<ImageSize> ImageDecoder::size(std::span<const std::uint8_t> bytes) {
  if (bytes.empty()) return damaged("it is empty");
  const std::optional<ImageFormat> format = image_format(bytes);
  if (!format) return unsupported("its content is no JPEG, PNG, PGM (P5) or PPM (P6)");
  Result<ImageSize> size = *format == ImageFormat::kJpeg  ? jpeg_->size(bytes)
                           : *format == ImageFormat::kPng ? png_size(bytes)
                                                          : pnm_size(bytes);
  if (size.ok() && size->pixels() > max_pixels_) return too_large(*size, max_pixels_);
  return size;
}

Result<ImageSize> ImageDecoder::decode(std::span<const std::uint8_t> bytes,
                                       std::span<std::uint8_t> luma) {
  Result<ImageSize> size = this->size(bytes);
  if (!size.ok()) return size;
  assert(luma.size() >= size->pixels());
  const ImageFormat format = *image_format(bytes);
  const Status status = format == ImageFormat::kJpeg  ? jpeg_->decode(bytes, *size, luma)
                        : format == ImageFormat::kPng ? decode_png(bytes, luma)
                                                      : decode_pnm(bytes, luma);
  if (!status.ok()) return status.error();
  return size;
}

}  // namespace loopd
