#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "image/image_write.h"
#include "make_sequence/sequence.h"

namespace loopd::sequence {
namespace {

namespace fs = std::filesystem;

std::string file_name(std::size_t index, ImageFormat format) {
  char name[32];
  std::snprintf(name, sizeof name, "%06zu.%s", index, format == ImageFormat::kPng ? "png" : "jpg");
  return name;
}

Status write_text(const fs::path& path, const std::string& text) {
  return image::write_file(path, text.data(), text.size());
}

/// An old run's images would join the new ones, so the folder must hold none but ours to replace.
Status prepare_folder(const fs::path& out, const Sequence& sequence) {
  std::error_code code;
  fs::create_directories(out / "images", code);
  if (code) return errno_error("cannot make folder " + (out / "images").string(), code.value());
  fs::directory_iterator entries(out / "images", code);
  if (code) return errno_error("cannot list folder " + (out / "images").string(), code.value());
  for (const fs::directory_entry& entry : entries) {
    const std::string name = entry.path().filename().string();
    bool ours = false;
    if (name.size() == 10 && name.find_first_not_of("0123456789") == 6) {
      const auto index = static_cast<std::size_t>(std::stoul(name.substr(0, 6)));
      ours = index < sequence.plan().size() && name == file_name(index, sequence.options().format);
    }
    if (!ours) {
      return Error{"cannot write images into " + (out / "images").string() + ": it already holds " +
                       name + ", which is not of this sequence; choose an empty folder",
                   EEXIST};
    }
  }
  return Nothing{};
}

std::string ground_truth_csv(const Sequence& sequence) {
  std::string text = "query,match,label\n";
  for (const TruePair& pair : ground_truth(sequence.plan(), sequence.options())) {
    text += std::to_string(pair.query) + ',' + std::to_string(pair.match) +
            (pair.label == 1 ? ",1\n" : ",0.5\n");
  }
  return text;
}

std::string poses_tum(const Sequence& sequence) {
  const double rate = sequence.options().fps > 0 ? sequence.options().fps : 10;
  std::string text;
  for (std::size_t i = 0; i < sequence.plan().size(); ++i) {
    const Pose& pose = sequence.plan()[i].pose;
    const auto q = quaternion_xyzw(pose);
    char line[256];
    std::snprintf(line, sizeof line, "%.6f %.6f %.6f %.6f %.9f %.9f %.9f %.9f\n",
                  static_cast<double>(i) / rate, pose.position.x, pose.position.y, pose.position.z,
                  q[0], q[1], q[2], q[3]);
    text += line;
  }
  return text;
}

std::string times_txt(const Sequence& sequence) {
  std::string text;
  for (std::size_t i = 0; i < sequence.plan().size(); ++i) {
    char line[64];
    std::snprintf(line, sizeof line, "%.6f\n", static_cast<double>(i) / sequence.options().fps);
    text += line;
  }
  return text;
}

std::string camera_json(const Camera& camera) {
  const nlohmann::ordered_json json = {{"model", "pinhole"},         {"width", camera.width_px},
                                       {"height", camera.height_px}, {"fx", camera.focal_px},
                                       {"fy", camera.focal_px},      {"cx", camera.cx_px},
                                       {"cy", camera.cy_px}};
  return json.dump() + "\n";
}

std::string info_json(const Sequence& sequence) {
  const SequenceOptions& o = sequence.options();
  const nlohmann::ordered_json options = {{"frames", o.frames},
                                          {"parked", o.parked},
                                          {"width", o.width_px},
                                          {"height", o.height_px},
                                          {"fov", o.fov_deg},
                                          {"laps", o.laps},
                                          {"step", o.step_m},
                                          {"loop", o.loop_m},
                                          {"seed", o.seed},
                                          {"texture", o.texture},
                                          {"sameness", o.sameness},
                                          {"noise", o.noise},
                                          {"blur", o.blur_px},
                                          {"exposure", o.exposure},
                                          {"offset", o.offset_m},
                                          {"lap_change", o.lap_change},
                                          {"gap", o.gap},
                                          {"dont_care", o.dont_care_m},
                                          {"fps", o.fps},
                                          {"format", o.format == ImageFormat::kPng ? "png" : "jpg"},
                                          {"jpeg_quality", o.jpeg_quality}};
  const nlohmann::ordered_json json = {
      {"tool", "make_sequence"},
      {"options", options},
      {"images", sequence.plan().size()},
      {"loop_m", sequence.loop_m()},
      {"pose",
       "TUM: time tx ty tz qx qy qz qw, world from camera, camera x right y down z "
       "forward; world z up; metres"}};
  return json.dump(1) + "\n";
}

Status write_texts(const Sequence& sequence, const fs::path& out) {
  std::vector<std::pair<const char*, std::string>> files = {
      {"groundtruth.csv", ground_truth_csv(sequence)},
      {"poses.tum", poses_tum(sequence)},
      {"camera.json", camera_json(sequence.camera())},
      {"info.json", info_json(sequence)}};
  if (sequence.options().fps > 0) files.emplace_back("times.txt", times_txt(sequence));
  for (const auto& [name, text] : files) {
    if (Status status = write_text(out / name, text); !status) return status;
  }
  return Nothing{};
}

/// Hands out frames to threads and keeps the first error.
class Job {
 public:
  Job(const Sequence& sequence, const fs::path& out,
      const std::function<void(std::size_t, std::size_t)>& progress)
      : sequence_(sequence), out_(out), progress_(progress) {}

  void work() {
    FrameRenderer renderer(sequence_);
    while (true) {
      const std::size_t index = next_.fetch_add(1);
      if (index >= sequence_.plan().size() || failed_) return;
      finish(write(index, renderer.render(index)));
    }
  }
  std::optional<Error> error() const { return error_; }

 private:
  Status write(std::size_t index, const std::vector<std::uint8_t>& pixels) const {
    const SequenceOptions& o = sequence_.options();
    const LumaView view{pixels.data(), o.width_px, o.height_px, o.width_px};
    const fs::path path = out_ / "images" / file_name(index, o.format);
    return o.format == ImageFormat::kPng ? image::write_png(path, view)
                                         : image::write_jpeg(path, view, o.jpeg_quality);
  }
  void finish(const Status& status) {
    const std::lock_guard lock(mutex_);
    if (status) {
      if (progress_) progress_(++done_, sequence_.plan().size());
    } else if (!failed_) {
      error_ = status.error();
      failed_ = true;
    }
  }

  const Sequence& sequence_;
  const fs::path& out_;
  const std::function<void(std::size_t, std::size_t)>& progress_;
  std::atomic<std::size_t> next_{0};
  std::atomic<bool> failed_{false};
  std::mutex mutex_;
  std::size_t done_ = 0;
  std::optional<Error> error_;
};

}  // namespace

Status write_sequence(const SequenceOptions& options, const fs::path& out, int threads,
                      const std::function<void(std::size_t, std::size_t)>& progress) {
  if (const auto bad = validate(options); !bad.empty()) {
    std::string all = "cannot render the sequence:";
    for (const std::string& sentence : bad) all += "\n  " + sentence;
    return Error{all, EINVAL};
  }
  const Sequence sequence(options);
  if (Status status = prepare_folder(out, sequence); !status) return status;
  Job job(sequence, out, progress);
  {
    std::vector<std::jthread> workers;
    for (int i = 1; i < threads; ++i) workers.emplace_back([&job] { job.work(); });
    job.work();
  }
  if (job.error()) return *job.error();
  return write_texts(sequence, out);
}

}  // namespace loopd::sequence
