// loopd-video FILE: writes the frames of a video to standard output as one-plane YUV4MPEG2
// ("YUV4MPEG2 W640 H480 F30000:1001 Ip A1:1 Cmono", then "FRAME" and width x height bytes each).
//
// A process of its own so that the daemon links no video library (140 and more shared objects)
// and a hostile file can only end this program. Exit status: 0 at the end of the video, 1 on an
// error, which is one line on standard error.

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <string>
#include <vector>

#include "capture/luma.h"

namespace {

[[maybe_unused]] constexpr rlim_t kMaxMemoryBytes = rlim_t{4} << 30;

// Keeps standard error for our one line: the video libraries talk a lot.
int take_over_stderr() {
  const int own = ::fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  const int null = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (own < 0 || null < 0) return STDERR_FILENO;
  ::dup2(null, STDERR_FILENO);
  return own;
}

int fail(int stderr_fd, const std::string& message) {
  const std::string line = message + "\n";
  [[maybe_unused]] const ssize_t written = ::write(stderr_fd, line.data(), line.size());
  return EXIT_FAILURE;
}

bool write_all(const void* data, std::size_t length) {
  const auto* at = static_cast<const std::uint8_t*>(data);
  while (length > 0) {
    const ssize_t written = ::write(STDOUT_FILENO, at, length);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    at += written;
    length -= static_cast<std::size_t>(written);
  }
  return true;
}

// "F30000:1001 ", or nothing if the file gives no sensible rate.
std::string rate_field(double fps) {
  if (!(fps >= 0.01 && fps <= 10'000)) return "";
  const double ntsc = fps * 1001 / 1000;  // 29.97 is 30000:1001
  if (std::abs(ntsc - std::round(ntsc)) < 1e-4 && std::abs(fps - std::round(fps)) > 1e-4)
    return "F" + std::to_string(std::llround(ntsc) * 1000) + ":1001 ";
  return "F" + std::to_string(std::llround(fps * 1000)) + ":1000 ";
}

bool write_header(const cv::Mat& frame, double fps) {
  const std::string header = "YUV4MPEG2 W" + std::to_string(frame.cols) + " H" +
                             std::to_string(frame.rows) + " " + rate_field(fps) + "Ip A1:1 Cmono\n";
  return write_all(header.data(), header.size());
}

// Luma of an 8-bit grey, BGR or BGRA picture, packed; false for any other kind.
bool to_luma(const cv::Mat& frame, std::vector<std::uint8_t>& luma) {
  const int channels = frame.channels();
  if (frame.depth() != CV_8U || (channels != 1 && channels != 3 && channels != 4)) return false;
  luma.resize(frame.total());
  std::uint8_t* out = luma.data();
  for (int y = 0; y < frame.rows; ++y) {
    const std::uint8_t* in = frame.ptr<std::uint8_t>(y);
    for (int x = 0; x < frame.cols; ++x, in += channels)
      *out++ = channels == 1 ? in[0] : loopd::luma_from_rgb(in[2], in[1], in[0]);
  }
  return true;
}

bool is_file(const char* path) {
  struct stat status {};
  return ::stat(path, &status) == 0 && S_ISREG(status.st_mode);
}

bool open_video(cv::VideoCapture& video, const std::string& path) {
  // Only decoders of files: no picture series, no pipeline descriptions, no network.
  return video.open(path, cv::CAP_FFMPEG) || video.open(path, cv::CAP_OPENCV_MJPEG);
}

int decode(const std::string& path, int stderr_fd) {
  cv::VideoCapture video;
  if (!open_video(video, path)) return fail(stderr_fd, "no known video format");
  const double fps = video.get(cv::CAP_PROP_FPS);
  cv::Mat frame;
  cv::Size size;
  std::vector<std::uint8_t> luma;
  constexpr std::array<char, 6> kFrameLine{'F', 'R', 'A', 'M', 'E', '\n'};
  while (video.read(frame)) {
    if (frame.empty() || !to_luma(frame, luma))
      return fail(stderr_fd, "a frame is not 8-bit grey or colour");
    if (size.empty() && !write_header(frame, fps)) return EXIT_FAILURE;
    if (!size.empty() && size != frame.size())
      return fail(stderr_fd, "the size of the frames changes");
    size = frame.size();
    if (!write_all(kFrameLine.data(), kFrameLine.size()) || !write_all(luma.data(), luma.size()))
      return EXIT_FAILURE;
  }
  return size.empty() ? fail(stderr_fd, "it holds no frame that can be decoded") : EXIT_SUCCESS;
}

// A hostile file may ask for any amount. The sanitizers' shadow memory would count too.
void limit_memory() {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  const rlimit limit{kMaxMemoryBytes, kMaxMemoryBytes};
  ::setrlimit(RLIMIT_AS, &limit);
#endif
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return fail(STDERR_FILENO, "usage: loopd-video FILE");
  if (!is_file(argv[1])) return fail(STDERR_FILENO, "it is no file");
  limit_memory();
  // A playlist inside a file must not reach for the network.
  ::setenv("OPENCV_FFMPEG_CAPTURE_OPTIONS", "protocol_whitelist;file", 1);
  const int stderr_fd = take_over_stderr();
  try {
    return decode(argv[1], stderr_fd);
  } catch (const std::exception& error) {
    return fail(stderr_fd, error.what());
  }
}
