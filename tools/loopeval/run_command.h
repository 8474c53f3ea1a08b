#pragma once

#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace loopd::loopeval {

// Exit codes, as those of loopd(8).
inline constexpr int kDone = 0;
inline constexpr int kFailed = 1;       ///< the dataset cannot be read, the results not written
inline constexpr int kBadSettings = 2;  ///< command line or config

inline constexpr int kMaxGallery = 200;

/// Arguments of `loopeval run DATASET --out DIR`.
struct RunCommand {
  std::string dataset;
  std::optional<std::string> config_path;
  std::vector<std::string> sets;
  std::string out;
  int gallery = 0;  ///< pictures of accepted loops to draw, 0..kMaxGallery
  std::optional<int> lanes;
};

/// Declares the arguments on `app` (a subcommand); parsing fills `command`, which must outlive it.
void add_run_options(CLI::App& app, RunCommand& command);

/// Runs the detector over the dataset in lock-step and writes DIR/frames.csv, DIR/summary.json and
/// DIR/gallery/. Prints a summary to `out`, mistakes and failures to `err`, progress to standard
/// error. Returns the exit code.
int run_dataset(const RunCommand& command, std::ostream& out, std::ostream& err);

}  // namespace loopd::loopeval
