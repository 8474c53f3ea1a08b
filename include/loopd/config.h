#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace loopd {

// Every parameter has its default here and its unit, range and reason in the table behind
// `parameters()` (src/loop/config.cpp); the shipped config file is held equal to both by a test.

struct FeaturesConfig {
  int points = 1500;
  int lines = 300;
  int max_pixels = 1'000'000;
  int fast_threshold = 7;
  double scale_factor = 1.2;
  int levels = 8;
  double min_line_length = 0.03;
  int min_features = 20;
};

struct IndexConfig {
  double word_ratio = 0.8;
  int max_word_distance = 64;
  int probation_images = 10;
};

struct LoopConfig {
  int waiting_frames = 50;
  double waiting_s = 15.0;
  double min_similarity = 0.3;
  double one_list_penalty = 0.5;
  int max_candidates = 64;
  int island_gap = 5;
  int verified_islands = 3;
  int verified_images = 2;
  int checked_images = 2;
  double still_fraction = 0.75;
  double still_radius_px = 1.0;
};

struct VerifyConfig {
  double point_ratio = 0.8;
  int max_point_distance = 64;
  double line_ratio = 0.8;
  int max_line_distance = 80;
  double max_line_angle_deg = 20.0;
  int line_neighbours = 8;
  bool line_angle_filter = true;
  double epipolar_px = 2.0;
  int max_iterations = 1000;
  int min_inliers = 35;
  double min_agreement = 0.62;
  int seed = 1;
};

/// Every parameter of the detector. Plain values: copy it, change it, `validate` it once.
struct Config {
  FeaturesConfig features;
  IndexConfig index;
  LoopConfig loop;
  VerifyConfig verify;
  /// For everything the detector keeps: images, words, look-up tables. Its capacities follow from
  /// it and never change. The daemon gives it what memory.budget_mib leaves.
  std::int64_t memory_budget_bytes = std::int64_t{192} << 20;
};

/// Where one parameter's value lives inside a config.
using ParameterRef = std::variant<bool*, int*, double*, std::string*, std::vector<int>*>;

/// Describes one parameter of config type `C`. `min` and `max` are inclusive and bound numbers (and
/// each element of a list); for strings they bound the length in bytes.
template <class C>
struct Parameter {
  std::string_view key;  ///< "section.name", as in the config file and for --set
  std::string_view unit;
  double min = 0;
  double max = 0;
  std::string_view reason;  ///< what it does and why the default is what it is
  ParameterRef (*ref)(C&) = nullptr;
};

/// All parameters of the detector, in the order of the config file.
std::span<const Parameter<Config>> parameters();

/// All violations of range, one sentence each ("verify.min_inliers = 3. Violated: >= 8 ..."),
/// naming key, value and constraint; empty if `config` may be used.
std::vector<std::string> validate(const Config& config);

}  // namespace loopd
