#include "loopeval/progress.h"

#include <unistd.h>

#include <cstdio>

#include "base/clock.h"

namespace loopd::loopeval {
namespace {

constexpr std::int64_t kTerminalInterval_ns = 200'000'000;
constexpr std::int64_t kLineInterval_ns = 10'000'000'000;
constexpr std::size_t kMostNotes = 10;

constexpr const char* kEraseLine = "\r\033[K";

}  // namespace

Progress Progress::on_stderr(std::optional<std::size_t> total) {
  return Progress(isatty(STDERR_FILENO) == 1, total);
}

Progress::Progress(bool terminal, std::optional<std::size_t> total)
    : terminal_(terminal),
      total_(total),
      began_ns_(monotonic_now_ns()),
      next_ns_(began_ns_ + (terminal ? kTerminalInterval_ns : kLineInterval_ns)) {}

void Progress::show(std::size_t frames, std::size_t loops) {
  const std::int64_t now_ns = monotonic_now_ns();
  if (now_ns < next_ns_) return;
  next_ns_ = now_ns + (terminal_ ? kTerminalInterval_ns : kLineInterval_ns);
  const double rate_hz =
      static_cast<double>(frames) * 1e9 / static_cast<double>(now_ns - began_ns_);
  const std::string of = total_ ? " of " + std::to_string(*total_) : "";
  std::fprintf(stderr, "%sloopeval: %zu%s frames, %.1f frames/s, %zu loops%s",
               terminal_ ? kEraseLine : "", frames, of.c_str(), rate_hz, loops,
               terminal_ ? "" : "\n");
  std::fflush(stderr);
}

void Progress::note(const std::string& text) {
  if (++notes_ > kMostNotes) return;
  std::fprintf(stderr, "%sloopeval: %s\n", terminal_ ? kEraseLine : "", text.c_str());
}

void Progress::end() {
  if (terminal_) std::fputs(kEraseLine, stderr);
  if (notes_ > kMostNotes)
    std::fprintf(stderr, "loopeval: and %zu more frames that could not be read\n",
                 notes_ - kMostNotes);
}

}  // namespace loopd::loopeval
