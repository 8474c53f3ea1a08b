#pragma once

#include <iosfwd>
#include <string>

#include "eval/score.h"

namespace CLI {
class App;
}

namespace loopd::eval {

/// Arguments of `loopeval score FRAMES.csv GROUNDTRUTH.csv`.
struct ScoreCommand {
  std::string frames;
  std::string ground_truth;
  ScoreOptions options;
  std::string out;    ///< folder for pr.csv, pr.png and score.json; empty = none written
  bool json = false;  ///< print JSON in place of text
};

/// Declares the arguments on `app` (a subcommand); parsing fills `command`, which must outlive it.
void add_score_options(CLI::App& app, ScoreCommand& command);

/// Scores, prints to `out`, writes the files. Returns the exit code: 0, or 1 with one sentence on
/// `err`.
int run_score(const ScoreCommand& command, std::ostream& out, std::ostream& err);

/// The score as one JSON object (fractions, not percent; null where undefined).
std::string score_json(const Score& score, const ScoreOptions& options);

}  // namespace loopd::eval
