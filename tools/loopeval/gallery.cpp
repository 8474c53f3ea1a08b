#include "loopeval/gallery.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <optional>
#include <span>
#include <tuple>
#include <variant>

#include "base/frame_pool.h"
#include "capture/camera.h"
#include "eval/draw_matches.h"
#include "loopeval/evaluation.h"

namespace loopd::loopeval {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kAlike = 10;  // frames

using Frames = std::map<std::uint64_t, std::optional<Frame>>;

/// Reads on to frame `sequence`.
Result<Frame> read_frame(Camera& camera, std::uint64_t sequence) {
  while (true) {
    const CameraEvent event = camera.next();
    if (const auto* frame = std::get_if<Frame>(&event)) {
      if (frame->sequence == sequence)
        return copy_to_frame(frame->view(), sequence, frame->time_ns);
    } else if (const auto* error = std::get_if<CameraError>(&event)) {
      if (error->lost || error->sequence == sequence) return Error{error->message, error->code};
    } else {
      return Error{"cannot read frame " + std::to_string(sequence) +
                       " again for its picture: the recording ends before it",
                   0};
    }
  }
}

/// Fills in the frames. A folder is opened at each of them, a video read through once.
Status read_again(DaemonConfig config, Frames& frames) {
  FramePool pool(1, static_cast<std::size_t>(config.camera.max_pixels));
  std::error_code ignored;
  const bool is_folder = fs::is_directory(config.camera.path, ignored);
  std::unique_ptr<Camera> camera;
  for (auto& [sequence, frame] : frames) {
    if (!camera || is_folder) {
      config.camera.start = is_folder ? static_cast<int>(sequence) : 0;
      auto opened = open_recording(config, pool);
      if (!opened) return opened.error();
      camera = std::move(opened).value();
    }
    Result<Frame> read = read_frame(*camera, sequence);
    if (!read) return read.error();
    frame = std::move(read).value();
  }
  return Nothing{};
}

std::string picture_name(std::size_t rank, std::uint64_t query, std::uint64_t match) {
  std::array<char, 80> name{};
  std::snprintf(name.data(), name.size(), "loop_%03zu_%06llu_%06llu.png", rank,
                static_cast<unsigned long long>(query), static_cast<unsigned long long>(match));
  return name.data();
}

bool is_picture(const fs::path& path) {
  return path.filename().string().starts_with("loop_") && path.extension() == ".png";
}

Status make_empty(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return errno_error("cannot make the folder " + folder.string(), error.value());
  std::vector<fs::path> old;
  for (const auto& entry : fs::directory_iterator(folder, error))
    if (is_picture(entry.path())) old.push_back(entry.path());
  for (const fs::path& path : old) {
    fs::remove(path, error);
    if (error) return errno_error("cannot remove " + path.string(), error.value());
  }
  return Nothing{};
}

}  // namespace

bool Gallery::better(const Loop& a, const Loop& b) {
  return std::tuple(-a.spread_inliers, -a.inliers, a.query) <
         std::tuple(-b.spread_inliers, -b.inliers, b.query);
}

Gallery::Loop Gallery::loop_of(const Report& report, const std::string& file) {
  const Verification& v = *report.verification;
  std::array<char, 200> numbers{};
  std::snprintf(numbers.data(), numbers.size(), "%d inliers: %d points, %d lines; similarity %.2f",
                v.inliers(), v.point_inliers, v.line_inliers, report.match->similarity);
  return {.query = report.sequence,
          .match = report.match->sequence,
          .spread_inliers = v.spread_inliers,
          .inliers = v.inliers(),
          .caption = "frame " + std::to_string(report.sequence) + " (" + file + ", left) = frame " +
                     std::to_string(report.match->sequence) + "   " + numbers.data(),
          .pairs = {report.pairs.begin(), report.pairs.end()}};
}

void Gallery::offer(const Report& report, const std::string& file) {
  if (capacity_ == 0 || report.outcome != Outcome::kLoop || !report.match || !report.verification)
    return;
  Loop loop = loop_of(report, file);
  const auto alike = [&loop](const Loop& kept) { return kept.query + kAlike >= loop.query; };
  const auto rival = std::find_if(loops_.begin(), loops_.end(), alike);  // the best of them
  if (rival != loops_.end() && better(*rival, loop)) return;
  std::erase_if(loops_, alike);
  loops_.insert(std::upper_bound(loops_.begin(), loops_.end(), loop, better), std::move(loop));
  if (loops_.size() > capacity_) loops_.pop_back();
}

std::vector<std::uint64_t> Gallery::queries() const {
  std::vector<std::uint64_t> queries;
  for (const Loop& loop : loops_) queries.push_back(loop.query);
  return queries;
}

Status Gallery::draw(DaemonConfig config, const fs::path& folder) const {
  if (capacity_ == 0) return Nothing{};
  if (Status made = make_empty(folder); !made) return made;
  config.camera.faults.clear();
  std::error_code ignored;
  const bool is_folder = fs::is_directory(config.camera.path, ignored);
  const std::size_t batch = is_folder ? 1 : std::max<std::size_t>(1, loops_.size());
  for (std::size_t first = 0; first < loops_.size(); first += batch) {
    Frames frames;
    for (const Loop& loop : std::span(loops_).subspan(first, batch)) {
      frames[loop.query];
      frames[loop.match];
    }
    if (Status read = read_again(config, frames); !read) return read;
    for (std::size_t i = first; i < first + batch; ++i) {
      const Loop& loop = loops_[i];
      const Status drawn =
          eval::draw_matches(frames[loop.query]->view(), frames[loop.match]->view(), loop.pairs,
                             loop.caption, folder / picture_name(i + 1, loop.query, loop.match));
      if (!drawn) return drawn;
    }
  }
  return Nothing{};
}

}  // namespace loopd::loopeval
