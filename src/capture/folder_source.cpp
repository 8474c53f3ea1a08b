#include "capture/folder_source.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

#include "capture/fault_script.h"
#include "capture/read_file.h"
#include "capture/times_file.h"

namespace loopd {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxImages = 1'000'000;
constexpr std::size_t kMaxTimesBytes = 64u << 20;

// The most a plain file of so many pixels needs: 16-bit RGBA, and room for headers and comments.
std::size_t max_file_bytes(std::size_t max_pixels) { return 8 * max_pixels + (1u << 20); }

bool has_image_name(const fs::path& path) {
  constexpr std::array<std::string_view, 6> kExtensions{".jpg", ".jpeg", ".png",
                                                        ".pgm", ".ppm",  ".pnm"};
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

// Paths of the images in `folder`, sorted by name.
Result<std::vector<std::string>> images_of(const fs::path& folder) {
  std::vector<std::string> images;
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    if (has_image_name(entry->path())) images.push_back(entry->path().string());
    if (images.size() > kMaxImages)
      return Error{"the folder " + folder.string() + " holds more than a million images", EFBIG};
  }
  if (error) return errno_error("cannot list the folder " + folder.string(), error.value());
  if (images.empty())
    return Error{"no image in the folder " + folder.string() +
                     "; it needs files named *.jpg, *.jpeg, *.png, *.pgm, *.ppm or *.pnm",
                 ENOENT};
  std::sort(images.begin(), images.end());
  return images;
}

// The folder that holds the images: `path`, or the images/ in it.
fs::path image_folder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path / "images", ignored) ? path / "images" : path;
}

// The times of `images` images from the first times.txt among `folders`; empty if there is none.
Result<std::vector<std::int64_t>> read_times(const std::vector<fs::path>& folders,
                                             std::size_t images) {
  for (const fs::path& folder : folders) {
    const std::string path = (folder / "times.txt").string();
    std::vector<std::uint8_t> bytes;
    const Status status = read_regular_file(path, kMaxTimesBytes, bytes);
    if (!status.ok() && status.error().code == ENOENT) continue;
    if (!status.ok()) return status.error();
    Result<std::vector<std::int64_t>> times =
        parse_times({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    if (!times.ok()) return Error{"bad times in " + path + ": " + times.error().message, EINVAL};
    if (times->size() != images)
      return Error{path + " has " + std::to_string(times->size()) + " times for " +
                       std::to_string(images) + " images; one line for each image is needed",
                   EINVAL};
    return times;
  }
  return std::vector<std::int64_t>();
}

CameraFault fault_of(int code) {
  switch (code) {
    case EBADMSG:
      return CameraFault::kCorruptFrame;
    case EFBIG:
      return CameraFault::kTooLarge;
    case ENOTSUP:
      return CameraFault::kUnsupported;
    case EACCES:
    case EPERM:
      return CameraFault::kPermission;
    default:
      return CameraFault::kStreamError;
  }
}

class FolderSource : public FrameSource {
 public:
  FolderSource(const SourceOptions& options, std::vector<std::string> images,
               std::vector<std::int64_t> times)
      : options_(options),
        images_(std::move(images)),
        times_(std::move(times)),
        decoder_(options.max_pixels) {}

  Prepared prepare(std::uint64_t sequence, bool corrupt) override {
    if (!options_.loop && sequence >= images_.size()) return EndOfStream{};
    sequence_ = sequence;
    const Status status = read_regular_file(path(), max_file_bytes(options_.max_pixels), bytes_);
    if (!status.ok()) return error_of(status.error().message, status.error().code);
    if (corrupt) bytes_.resize(bytes_.size() / 2);
    const Result<ImageSize> size = decoder_.size(bytes_);
    if (!size.ok()) return decode_error(size.error());
    return size.value();
  }

  std::optional<CameraError> decode(std::span<std::uint8_t> luma) override {
    const Result<ImageSize> size = decoder_.decode(bytes_, luma);
    if (!size.ok()) return decode_error(size.error());
    return std::nullopt;
  }

  std::optional<std::int64_t> time_ns(std::uint64_t sequence) const override {
    if (!times_.empty()) return recorded_time(sequence);
    if (options_.nominal_fps > 0)
      return std::llround(static_cast<double>(sequence) * 1e9 / options_.nominal_fps);
    return std::nullopt;
  }

  std::uint64_t length() const override { return images_.size(); }

  std::string describe() const override {
    std::vector<std::uint8_t> bytes;
    ImageDecoder decoder(options_.max_pixels);
    const Status status = read_regular_file(images_[0], max_file_bytes(options_.max_pixels), bytes);
    const Result<ImageSize> size =
        status.ok() ? decoder.size(bytes) : Result<ImageSize>(status.error());
    const std::string first = size.ok() ? std::to_string(size.value().width_px) + "x" +
                                              std::to_string(size.value().height_px)
                                        : "unreadable";
    return "folder of " + std::to_string(images_.size()) +
           (images_.size() == 1 ? " image, " : " images, the first ") + first +
           (times_.empty() ? "" : ", with times") + ", " + options_.path;
  }

 private:
  const std::string& path() const { return images_[sequence_ % images_.size()]; }

  // A later lap starts one mean step after the end of the one before.
  std::int64_t recorded_time(std::uint64_t sequence) const {
    const auto count = static_cast<std::int64_t>(times_.size());
    const auto lap = static_cast<std::int64_t>(sequence) / count;
    const std::int64_t time = times_[static_cast<std::size_t>(sequence % times_.size())];
    std::int64_t span = 0;
    std::int64_t offset = 0;
    if (__builtin_sub_overflow(times_.back(), times_.front(), &span) ||
        __builtin_add_overflow(span, count > 1 ? span / (count - 1) : 0, &span) ||
        __builtin_mul_overflow(span, lap, &offset))
      return time;  // times that span centuries; they stay as they are
    return saturating_add(time, offset);
  }

  CameraError error_of(std::string message, int code) const {
    return {fault_of(code), std::move(message), code, false, sequence_};
  }

  CameraError decode_error(const Error& error) const {
    return error_of("cannot decode " + path() + ": " + error.message, error.code);
  }

  const SourceOptions options_;
  const std::vector<std::string> images_;  ///< paths
  const std::vector<std::int64_t> times_;  ///< one an image, or empty
  ImageDecoder decoder_;
  std::vector<std::uint8_t> bytes_;  ///< the prepared file
  std::uint64_t sequence_ = 0;       ///< of the prepared file
};

}  // namespace

Result<std::vector<std::string>> list_images(const std::string& path) {
  std::error_code ignored;
  if (!fs::is_directory(path, ignored)) return std::vector<std::string>{path};
  return images_of(image_folder(path));
}

Result<std::unique_ptr<FrameSource>> open_folder_source(const SourceOptions& options) {
  const fs::path path = options.path;
  Result<std::vector<std::string>> images = list_images(options.path);
  if (!images.ok()) return images.error();
  Result<std::vector<std::int64_t>> times = std::vector<std::int64_t>();
  std::error_code ignored;
  if (fs::is_directory(path, ignored))
    times = read_times({path, image_folder(path)}, images->size());
  if (!times.ok()) return times.error();
  return std::unique_ptr<FrameSource>(
      std::make_unique<FolderSource>(options, std::move(images).value(), std::move(times).value()));
}

}  // namespace loopd
