#include "eval/score_command.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <ostream>

#include "eval/pr_plot.h"
#include "image/image_write.h"

namespace loopd::eval {
namespace {

using Json = nlohmann::ordered_json;

std::string percent(double fraction) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f %%", 100 * fraction);
  return text;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

Json counts_json(const Counts& counts, bool any_match) {
  Json json = {{"precision", counts.right + counts.wrong > 0 ? Json(counts.precision) : Json()},
               {"recall", any_match ? Json(counts.recall) : Json()},
               {"right", counts.right},
               {"wrong", counts.wrong},
               {"dont_care", counts.dont_care}};
  return json;
}

void print_full_precision(const Score& score, const std::string& column, std::ostream& out) {
  out << "recall at 100 % precision: ";
  if (score.queries_with_match == 0) {
    out << "undefined, no query has a match in the ground truth\n";
  } else if (!score.full_precision) {
    out << "0.00 % ("
        << (score.candidates == 0 ? "no frame has a candidate" : "the highest score is false")
        << ")\n";
  } else {
    const Counts& best = score.full_precision->counts;
    out << percent(best.recall) << " (" << best.right << " of " << score.queries_with_match
        << ") at " << column << " >= " << number(score.full_precision->threshold) << '\n';
  }
}

void print(const Score& score, const ScoreOptions& options, std::ostream& out) {
  const Counts& accepted = score.accepted;
  out << "frames: " << score.frames << ", with a candidate: " << score.candidates
      << ", queries with a match: " << score.queries_with_match << '\n';
  if (score.queries_missing > 0) {
    out << "note: " << score.queries_missing
        << " of these queries are not among the frames and count as missed\n";
  }
  print_full_precision(score, options.score_column, out);
  const bool judged = accepted.right + accepted.wrong > 0;
  out << "accepted loops: precision " << (judged ? percent(accepted.precision) : "undefined")
      << ", recall "
      << (score.queries_with_match > 0 ? percent(accepted.recall) : std::string("undefined"))
      << " (" << accepted.right << " right, " << accepted.wrong << " false, " << accepted.dont_care
      << " don't care)\n";
}

Status write_files(const Score& score, const ScoreCommand& command) {
  const std::filesystem::path folder = command.out;
  std::error_code code;
  std::filesystem::create_directories(folder, code);
  if (code) return errno_error("cannot make folder " + folder.string(), code.value());
  if (Status status = write_pr_csv(score, folder / "pr.csv"); !status) return status;
  const std::string title = "Precision and recall over " + command.options.score_column;
  if (Status status = write_pr_png(score, title, folder / "pr.png"); !status) return status;
  const std::string json = score_json(score, command.options) + "\n";
  return image::write_file(folder / "score.json", json.data(), json.size());
}

}  // namespace

void add_score_options(CLI::App& app, ScoreCommand& command) {
  app.add_option("frames", command.frames, "FRAMES.csv of loopeval run")->required();
  app.add_option("groundtruth", command.ground_truth, "query,match,label")->required();
  app.add_option("--score", command.options.score_column, "column to sweep")->capture_default_str();
  app.add_option("--tolerance", command.options.tolerance,
                 "a match within so many images of a true one counts")
      ->capture_default_str()
      ->check(CLI::Range(0, kMaxTolerance));
  app.add_option("--out", command.out, "folder for pr.csv, pr.png and score.json");
  app.add_flag("--json", command.json, "print JSON");
}

std::string score_json(const Score& score, const ScoreOptions& options) {
  const bool any = score.queries_with_match > 0;
  Json best = nullptr;
  if (any && score.full_precision) {
    best = counts_json(score.full_precision->counts, any);
    best["threshold"] = score.full_precision->threshold;
  }
  const Json recall =
      any ? Json(score.full_precision ? score.full_precision->counts.recall : 0.0) : Json(nullptr);
  const Json json = {{"score", options.score_column},
                     {"tolerance", options.tolerance},
                     {"frames", score.frames},
                     {"candidates", score.candidates},
                     {"queries_with_match", score.queries_with_match},
                     {"queries_missing", score.queries_missing},
                     {"recall_at_full_precision", recall},
                     {"full_precision", best},
                     {"accepted", counts_json(score.accepted, any)}};
  return json.dump(1, ' ', false, Json::error_handler_t::replace);
}

int run_score(const ScoreCommand& command, std::ostream& out, std::ostream& err) {
  const auto score = score_files(command.frames, command.ground_truth, command.options);
  if (!score) {
    err << "loopeval score: " << score.error().message << '\n';
    return 1;
  }
  if (command.json) {
    out << score_json(score.value(), command.options) << '\n';
  } else {
    print(score.value(), command.options, out);
  }
  if (command.out.empty()) return 0;
  if (const Status status = write_files(score.value(), command); !status) {
    err << "loopeval score: " << status.error().message << '\n';
    return 1;
  }
  return 0;
}

}  // namespace loopd::eval
