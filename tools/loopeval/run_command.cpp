#include "loopeval/run_command.h"

#include <CLI/CLI.hpp>
#include <filesystem>
#include <ostream>

#include "app/config_file.h"
#include "image/image_write.h"
#include "loopeval/evaluation.h"
#include "loopeval/frames_csv.h"
#include "loopeval/gallery.h"
#include "loopeval/progress.h"
#include "loopeval/summary.h"

namespace loopd::loopeval {
namespace {

namespace fs = std::filesystem;

/// The config with what an evaluation fixes: this dataset, once, in lock-step.
LoadedConfig config_of(const RunCommand& command) {
  LoadedConfig loaded = load_config(command.config_path, command.sets);
  CameraConfig& camera = loaded.config.camera;
  camera.path = command.dataset;
  camera.fps = 0;
  camera.loop = false;
  if (command.lanes) loaded.config.threads.lanes = *command.lanes;
  return loaded;
}

Status make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return errno_error("cannot make the folder " + folder.string(), error.value());
  return Nothing{};
}

Status write_summary(const Summary& summary, const DaemonConfig& config, const fs::path& path) {
  const std::string json = summary_json(summary, config);
  return image::write_file(path, json.data(), json.size());
}

/// Everything from the open dataset to the written results.
Status evaluate(const DaemonConfig& config, const RunCommand& command, std::ostream& out) {
  Result<std::unique_ptr<Evaluation>> evaluation = Evaluation::open(config);
  if (!evaluation) return evaluation.error();
  const fs::path folder = command.out;
  if (Status made = make_folder(folder); !made) return made;
  Result<FramesCsv> csv = FramesCsv::create(folder / "frames.csv");
  if (!csv) return csv.error();
  Gallery gallery(static_cast<std::size_t>(command.gallery));
  Progress progress = Progress::on_stderr(evaluation.value()->length());
  const Status ran = evaluation.value()->run(csv.value(), gallery, progress);
  progress.end();
  if (!ran) return ran;
  if (Status finished = csv->finish(); !finished) return finished;
  const Summary& summary = evaluation.value()->summary();
  if (Status written = write_summary(summary, config, folder / "summary.json"); !written)
    return written;
  if (Status drawn = gallery.draw(config, folder / "gallery"); !drawn) return drawn;
  out << summary_text(summary) << "written: " << (folder / "frames.csv").string()
      << ", summary.json"
      << (gallery.size() > 0 ? ", gallery/ with " + std::to_string(gallery.size()) : "") << '\n';
  return Nothing{};
}

}  // namespace

void add_run_options(CLI::App& app, RunCommand& command) {
  app.add_option("DATASET", command.dataset,
                 "dataset folder (with images/ in it), folder of images, image or video")
      ->required();
  app.add_option("--out", command.out, "folder for frames.csv and summary.json")
      ->required()
      ->type_name("DIR");
  app.add_option("--config", command.config_path, "config file, see loopd.toml(5)")
      ->type_name("FILE");
  app.add_option("--set", command.sets, "set one parameter, over the config file; may be repeated")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  app.add_option("--gallery", command.gallery,
                 "draw the N most convincing loops as PNGs in DIR/gallery")
      ->type_name("N")
      ->check(CLI::Range(0, kMaxGallery));
  app.add_option("--lanes", command.lanes,
                 "1 or 2 threads for points and lines, in place of threads.lanes")
      ->check(CLI::Range(1, 2));
}

int run_dataset(const RunCommand& command, std::ostream& out, std::ostream& err) {
  const LoadedConfig loaded = config_of(command);
  for (const std::string& mistake : loaded.mistakes) err << "loopeval run: " << mistake << '\n';
  if (!loaded.ok()) return kBadSettings;
  if (const Status status = evaluate(loaded.config, command, out); !status) {
    err << "loopeval run: " << status.error().message << '\n';
    return kFailed;
  }
  return out.flush() ? kDone : kFailed;
}

}  // namespace loopd::loopeval
