#include "capture/video_source.h"

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <utility>

#include "base/clock.h"
#include "capture/child_process.h"
#include "capture/decode_formats.h"

namespace loopd {
namespace {

namespace fs = std::filesystem;

// Far more than a frame takes: starting the decoder loads hundreds of libraries from a cold disk.
constexpr std::int64_t kPatience_ns = 20'000'000'000;
constexpr std::int64_t kExitGrace_ns = 2'000'000'000;
constexpr std::size_t kMaxHeaderBytes = 256;
constexpr std::string_view kFrameLine = "FRAME\n";

std::optional<std::uint64_t> parse_whole(std::string_view text) {
  std::uint64_t value = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

// "30000:1001" as a number; 0 if it is none or makes no sense as a rate.
double parse_rate(std::string_view text) {
  const std::size_t colon = std::min(text.find(':'), text.size());
  const auto above = parse_whole(text.substr(0, colon));
  const auto below = parse_whole(text.substr(std::min(colon + 1, text.size())));
  if (!above || !below || *above == 0 || *below == 0) return 0;
  const double fps = static_cast<double>(*above) / static_cast<double>(*below);
  return fps >= 0.001 && fps <= 10'000 ? fps : 0;
}

std::string rate_text(double fps) {
  std::array<char, 32> text{};
  const auto end =
      std::to_chars(text.data(), text.data() + text.size(), fps, std::chars_format::general, 5);
  return {text.data(), end.ptr};
}

std::string describe_exit(int status) {
  if (WIFSIGNALED(status)) return "was killed by signal " + std::to_string(WTERMSIG(status));
  return "ended with status " + std::to_string(WEXITSTATUS(status));
}

// The output of one decoder process, from the header on.
class DecoderStream {
 public:
  enum class Got : std::uint8_t { kAll, kEnd, kCut, kSilence, kInterrupted };

  DecoderStream(ChildProcess process, const Interrupt& interrupt)
      : process_(std::move(process)), interrupt_(&interrupt) {}

  /// How the process ended; one that has closed its output, but goes on, is killed.
  int exit_status() {
    interrupt_->wait_readable(process_.exit_fd(), monotonic_now_ns() + kExitGrace_ns);
    return process_.finish();
  }

  /// The first line of what it said on standard error.
  std::string complaint() {
    const std::string text = process_.error_text(512);
    return text.substr(0, text.find('\n'));
  }

  /// Fills `out`. kEnd: the output had ended before; kCut: it ended in the middle.
  Got read(std::span<std::uint8_t> out) {
    const std::int64_t deadline_ns = monotonic_now_ns() + kPatience_ns;
    std::size_t length = 0;
    while (length < out.size()) {
      const ssize_t got = ::read(process_.output(), out.data() + length, out.size() - length);
      if (got > 0) {
        length += static_cast<std::size_t>(got);
        continue;
      }
      if (got == 0) return length == 0 ? Got::kEnd : Got::kCut;
      if (errno == EINTR) continue;
      if (errno != EAGAIN) return Got::kCut;
      const Interrupt::Ready ready = interrupt_->wait_readable(process_.output(), deadline_ns);
      if (ready == Interrupt::Ready::kInterrupted) return Got::kInterrupted;
      if (ready == Interrupt::Ready::kTimeout) return Got::kSilence;
    }
    return Got::kAll;
  }

  /// Reads up to the first line feed, which is not kept.
  Got read_line(std::string& line) {
    line.clear();
    std::uint8_t byte = 0;
    while (line.size() <= kMaxHeaderBytes) {
      const Got got = read({&byte, 1});
      if (got != Got::kAll) return got == Got::kEnd && !line.empty() ? Got::kCut : got;
      if (byte == '\n') return Got::kAll;
      line.push_back(static_cast<char>(byte));
    }
    return Got::kAll;
  }

 private:
  ChildProcess process_;
  const Interrupt* interrupt_;
};

using Got = DecoderStream::Got;

struct OpenVideo {
  DecoderStream stream;
  Y4mHeader header;
};

class VideoSource : public FrameSource {
 public:
  VideoSource(const SourceOptions& options, std::vector<std::string> command, OpenVideo video,
              const Interrupt& interrupt)
      : options_(options),
        command_(std::move(command)),
        interrupt_(&interrupt),
        video_(std::move(video)),
        pixels_(video_.header.size.pixels()) {}

  Prepared prepare(std::uint64_t sequence, bool corrupt) override {
    while (!ended_ && position_ <= sequence) {
      const Got got = read_frame();
      if (got == Got::kAll) {
        ++position_;
        ++lap_frames_;
      } else if (got == Got::kInterrupted) {
        return Interrupted{};
      } else if (std::optional<CameraError> error = at_end(got, sequence)) {
        return *std::move(error);
      }
    }
    if (ended_) return EndOfStream{};
    if (corrupt)
      return CameraError{CameraFault::kCorruptFrame,
                         "frame " + std::to_string(sequence) + " of " + options_.path +
                             " is damaged by the fault script",
                         EBADMSG, false, sequence};
    return video_.header.size;
  }

  std::optional<CameraError> decode(std::span<std::uint8_t> luma) override {
    std::copy(pixels_.begin(), pixels_.end(), luma.begin());
    return std::nullopt;
  }

  std::optional<std::int64_t> time_ns(std::uint64_t sequence) const override {
    const double fps = options_.nominal_fps > 0 ? options_.nominal_fps : video_.header.fps;
    if (fps <= 0) return std::nullopt;
    return std::llround(static_cast<double>(sequence) * 1e9 / fps);
  }

  std::uint64_t length() const override { return 0; }

  std::string describe() const override {
    const Y4mHeader& header = video_.header;
    return "video of " + std::to_string(header.size.width_px) + "x" +
           std::to_string(header.size.height_px) +
           (header.fps > 0 ? " at " + rate_text(header.fps) + " fps, " : ", ") + options_.path;
  }

  static Result<OpenVideo> open(const SourceOptions& options,
                                const std::vector<std::string>& command,
                                const Interrupt& interrupt);

 private:
  Got read_frame() {
    std::array<std::uint8_t, kFrameLine.size()> line{};
    const Got got = video_.stream.read(line);
    if (got != Got::kAll) return got;
    if (std::memcmp(line.data(), kFrameLine.data(), line.size()) != 0) return Got::kCut;
    const Got body = video_.stream.read(pixels_);
    return body == Got::kEnd ? Got::kCut : body;
  }

  // The output has ended: by the end of the video, which may start over, or by a failure.
  std::optional<CameraError> at_end(Got got, std::uint64_t sequence) {
    ended_ = true;
    if (got == Got::kSilence)
      return failure(CameraFault::kStalled, "the decoder gave nothing for 20 s", sequence);
    const int status = video_.stream.exit_status();
    if (got == Got::kCut || status != 0)
      return failure(CameraFault::kStreamError, "its decoder " + describe_exit(status), sequence);
    if (!options_.loop || lap_frames_ == 0) return std::nullopt;
    Result<OpenVideo> again = open(options_, command_, *interrupt_);
    if (interrupt_->requested()) return std::nullopt;
    if (!again.ok())
      return CameraError{CameraFault::kStreamError, again.error().message, 0, true, sequence};
    video_ = std::move(again).value();
    pixels_.resize(video_.header.size.pixels());
    lap_frames_ = 0;
    ended_ = false;
    return std::nullopt;
  }

  CameraError failure(CameraFault fault, const std::string& cause, std::uint64_t sequence) {
    const std::string said = video_.stream.complaint();
    return {fault,
            "cannot go on with the video " + options_.path + " after frame " +
                std::to_string(position_) + ": " + cause + (said.empty() ? "" : " (" + said + ")"),
            0, true, sequence};
  }

  const SourceOptions options_;
  const std::vector<std::string> command_;
  const Interrupt* interrupt_;
  OpenVideo video_;
  std::vector<std::uint8_t> pixels_;  ///< the newest frame read
  std::uint64_t position_ = 0;        ///< frames read, over all laps
  std::uint64_t lap_frames_ = 0;      ///< frames read in this lap
  bool ended_ = false;
};

Error cannot_decode(const SourceOptions& options, const std::string& cause) {
  return {"cannot decode the video " + options.path + ": " + cause, 0};
}

Result<OpenVideo> VideoSource::open(const SourceOptions& options,
                                    const std::vector<std::string>& command,
                                    const Interrupt& interrupt) {
  Result<ChildProcess> process = ChildProcess::start(command);
  if (!process.ok()) return process.error();
  OpenVideo video{DecoderStream(std::move(process).value(), interrupt), {}};
  std::string line;
  const Got got = video.stream.read_line(line);
  if (got == Got::kSilence) return cannot_decode(options, "its decoder gave nothing for 20 s");
  if (got == Got::kInterrupted) return cannot_decode(options, "interrupted");
  if (got != Got::kAll) {
    const int status = video.stream.exit_status();
    const std::string said = video.stream.complaint();
    return cannot_decode(options, said.empty() ? command[0] + " " + describe_exit(status) : said);
  }
  const Result<Y4mHeader> header = parse_y4m_header(line);
  if (!header.ok()) return cannot_decode(options, header.error().message);
  if (header.value().size.pixels() > options.max_pixels)
    return cannot_decode(options, "its frames are " + std::to_string(header.value().size.width_px) +
                                      "x" + std::to_string(header.value().size.height_px) +
                                      ", more than the " + std::to_string(options.max_pixels) +
                                      " pixels of camera.max_pixels");
  video.header = header.value();
  return video;
}

}  // namespace

Result<Y4mHeader> parse_y4m_header(std::string_view line) {
  constexpr std::string_view kMagic = "YUV4MPEG2 ";
  const Error bad{"its decoder wrote no valid YUV4MPEG2 header of one-plane video", EBADMSG};
  if (!line.starts_with(kMagic)) return bad;
  std::optional<std::uint64_t> width;
  std::optional<std::uint64_t> height;
  bool mono = false;
  Y4mHeader header;
  for (std::size_t at = kMagic.size(); at < line.size();) {
    const std::size_t end = std::min(line.find(' ', at), line.size());
    const std::string_view field = line.substr(at, end - at);
    at = end + 1;
    if (field.starts_with('W')) width = parse_whole(field.substr(1));
    if (field.starts_with('H')) height = parse_whole(field.substr(1));
    if (field.starts_with('F')) header.fps = parse_rate(field.substr(1));
    if (field.starts_with('C')) mono = field == "Cmono";
  }
  if (!width || !height || !mono) return bad;
  const Result<ImageSize> size = checked_size(*width, *height);
  if (!size.ok()) return bad;
  header.size = size.value();
  return header;
}

std::vector<std::string> video_decoder_candidates(const std::string& chosen) {
  if (!chosen.empty()) return {chosen};
  std::vector<std::string> candidates;
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  if (!error) candidates.push_back((self.parent_path() / "loopd-video").string());
  candidates.push_back(LOOPD_LIBEXEC_DIR "/loopd-video");
  candidates.push_back("loopd-video");
  return candidates;
}

Result<std::unique_ptr<FrameSource>> open_video_source(const SourceOptions& options,
                                                       const std::string& decoder,
                                                       const Interrupt& interrupt) {
  std::error_code error;
  // Absolute, so that no name can be taken for an option, a pattern or the address of a stream.
  const fs::path path = fs::canonical(options.path, error);
  if (error) return errno_error("cannot open " + options.path, error.value());
  for (const std::string& program : video_decoder_candidates(decoder)) {
    if (program.find('/') != std::string::npos && ::access(program.c_str(), X_OK) != 0) continue;
    const std::vector<std::string> command{program, path.string()};
    Result<OpenVideo> video = VideoSource::open(options, command, interrupt);
    if (!video.ok() && video.error().code == ENOENT) continue;
    if (!video.ok()) return video.error();
    return std::unique_ptr<FrameSource>(
        std::make_unique<VideoSource>(options, command, std::move(video).value(), interrupt));
  }
  return Error{"cannot decode the video " + options.path + ": the program " +
                   (decoder.empty() ? "loopd-video" : decoder) +
                   " is not there or cannot be run; install it beside loopd or in PATH",
               ENOENT};
}

}  // namespace loopd
