// loopeval: runs the detector over a dataset and judges the result (docs/loopeval.1).

#include <CLI/CLI.hpp>
#include <exception>
#include <iostream>

#include "eval/score_command.h"
#include "loopeval/run_command.h"

namespace {

using namespace loopd;

int run(int argc, char** argv) {
  CLI::App app("Runs the loop detector over recorded images and judges what it finds.");
  app.set_version_flag("--version", "loopeval " LOOPD_VERSION);
  app.require_subcommand(1);
  loopeval::RunCommand run_command;
  CLI::App* run = app.add_subcommand("run", "Detect loops in a dataset; write a row a frame.");
  loopeval::add_run_options(*run, run_command);
  eval::ScoreCommand score_command;
  CLI::App* score = app.add_subcommand("score", "Judge a frames.csv by its ground truth.");
  eval::add_score_options(*score, score_command);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& stop) {
    return app.exit(stop) == 0 ? 0 : loopeval::kBadSettings;
  }
  if (*score) return eval::run_score(score_command, std::cout, std::cerr);
  return loopeval::run_dataset(run_command, std::cout, std::cerr);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    std::cerr << "loopeval: " << error.what() << std::endl;
    return loopd::loopeval::kFailed;
  }
}
