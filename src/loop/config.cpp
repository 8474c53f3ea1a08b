#include "loopd/config.h"

#include "loopd/capacity.h"

#include <array>
#include <charconv>
#include <cmath>

namespace loopd {
namespace {

#define LOOPD_REF(field) [](Config& c) -> ParameterRef { return &c.field; }

// Key, unit, smallest, largest, what it does and why the default is what it is.
const std::array kParameters = {
    Parameter<Config>{"features.points", "points", 0, 10000,
                      "ORB points a frame; 0 = lines alone. The paper's 1500.",
                      LOOPD_REF(features.points)},
    Parameter<Config>{"features.lines", "lines", 0, 2000,
                      "Line segments a frame, the longest first; 0 = points alone. More than 300 "
                      "adds short ones that are not found again.",
                      LOOPD_REF(features.lines)},
    Parameter<Config>{"features.max_pixels", "px", 10'000, 100'000'000,
                      "A larger image is reduced by a whole factor until it fits; coordinates stay "
                      "full-resolution. Bounds the time a frame takes.",
                      LOOPD_REF(features.max_pixels)},
    Parameter<Config>{"features.fast_threshold", "grey levels", 1, 100,
                      "Contrast of a FAST corner. Low, because plain walls offer little; the "
                      "strongest are kept anyway. Recall at 100 % precision on a plain corridor: "
                      "97.6 % with 7, 95.1 % with 12 and 20.",
                      LOOPD_REF(features.fast_threshold)},
    Parameter<Config>{"features.scale_factor", "ratio", 1.05, 2.0,
                      "Step between the levels of the image pyramid. Points are found on all of "
                      "them, lines on the first that is reduced.",
                      LOOPD_REF(features.scale_factor)},
    Parameter<Config>{"features.levels", "levels", 1, 12,
                      "Levels of the pyramid; 8 steps of 1.2 cover a factor of 3.6 in distance.",
                      LOOPD_REF(features.levels)},
    Parameter<Config>{"features.min_line_length", "of the image's smaller side", 0.005, 0.5,
                      "Shorter segments are dropped: their descriptors are not stable.",
                      LOOPD_REF(features.min_line_length)},
    Parameter<Config>{"features.min_features", "points + lines", 1, 1000,
                      "With fewer there is nothing to see: outcome no_features.",
                      LOOPD_REF(features.min_features)},

    Parameter<Config>{
        "index.word_ratio", "ratio", 0.1, 1.0,
        "A descriptor is its nearest word if d1 <= ratio * d2 (NNDR). The paper's 0.8.",
        LOOPD_REF(index.word_ratio)},
    Parameter<Config>{"index.max_word_distance", "bits", 0, 128,
                      "And if d1 is at most this: a lone word is no match for everything.",
                      LOOPD_REF(index.max_word_distance)},
    Parameter<Config>{"index.probation_images", "images", 0, 100'000,
                      "A word not seen in a second image within this many is deleted; 0 = never.",
                      LOOPD_REF(index.probation_images)},

    Parameter<Config>{"loop.waiting_frames", "images", 1, 100'000,
                      "The newest images that are not yet searchable: they show the place the "
                      "camera is at.",
                      LOOPD_REF(loop.waiting_frames)},
    Parameter<Config>{"loop.waiting_s", "s", 0, 86'400,
                      "Where frame times are known, images younger than this are not searchable "
                      "either.",
                      LOOPD_REF(loop.waiting_s)},
    Parameter<Config>{"loop.min_similarity", "normalised score", 0, 1,
                      "Candidates below it in their list are dropped (after Eq. 1).",
                      LOOPD_REF(loop.min_similarity)},
    Parameter<Config>{"loop.one_list_penalty", "factor", 0, 1,
                      "Weight of an image that only one of the two lists holds (after Eq. 3).",
                      LOOPD_REF(loop.one_list_penalty)},
    Parameter<Config>{"loop.max_candidates", "images", 1, 64, "Length of each candidate list.",
                      LOOPD_REF(loop.max_candidates)},
    Parameter<Config>{"loop.island_gap", "images", 0, 1000,
                      "Retrieved images this close in time belong to the same island.",
                      LOOPD_REF(loop.island_gap)},
    Parameter<Config>{"loop.verified_islands", "islands", 1, 16,
                      "The best islands that are verified.", LOOPD_REF(loop.verified_islands)},
    Parameter<Config>{
        "loop.verified_images", "images", 1, 16,
        "Of each of them, the best images that are verified; the most convincing is the "
        "match.",
        LOOPD_REF(loop.verified_images)},
    Parameter<Config>{
        "loop.checked_images", "images", 1, 256,
        "Of all these, how many are checked for one geometry: those with the most matches "
        "that turn together, over the widest part of the view.",
        LOOPD_REF(loop.checked_images)},
    Parameter<Config>{"loop.still_fraction", "of the features found again", 0.01, 1,
                      "The camera has not moved if this share of what it sees again is exactly "
                      "where it was. Noise leaves more than 0.8, a slow hand less than 0.6.",
                      LOOPD_REF(loop.still_fraction)},
    Parameter<Config>{"loop.still_radius_px", "px", 0, 100,
                      "How far a point of the finest level may be from where it was and count as "
                      "not moved; coarser levels in proportion.",
                      LOOPD_REF(loop.still_radius_px)},

    Parameter<Config>{"verify.point_ratio", "ratio", 0.1, 1,
                      "NNDR of the point matches of two images.", LOOPD_REF(verify.point_ratio)},
    Parameter<Config>{"verify.max_point_distance", "bits", 0, 256,
                      "Largest Hamming distance of a point match.",
                      LOOPD_REF(verify.max_point_distance)},
    Parameter<Config>{"verify.line_ratio", "ratio", 0.1, 1,
                      "NNDR of the line matches, among lines of the right direction. 0.8 had "
                      "more recall at 100 % precision on real sequences than 0.9 and 0.95.",
                      LOOPD_REF(verify.line_ratio)},
    Parameter<Config>{"verify.max_line_distance", "bits", 0, 256,
                      "Largest Hamming distance of a line match.",
                      LOOPD_REF(verify.max_line_distance)},
    Parameter<Config>{"verify.line_neighbours", "lines", 1, 100,
                      "Nearest lines of the candidate that the angle filter sees; 5, 8 and 16 give "
                      "the same line inliers within 5 %.",
                      LOOPD_REF(verify.line_neighbours)},
    Parameter<Config>{"verify.line_angle_filter", "", 0, 1,
                      "Line matching by appearance and direction (the method); false = plain NNDR, "
                      "for comparison.",
                      LOOPD_REF(verify.line_angle_filter)},
    Parameter<Config>{"verify.max_line_angle_deg", "degrees", 1, 180,
                      "Eq. 5: larger angles between two lines, after the global rotation, are no "
                      "match.",
                      LOOPD_REF(verify.max_line_angle_deg)},
    Parameter<Config>{"verify.epipolar_px", "px", 0.1, 50,
                      "Largest Sampson distance of an inlier, at full resolution.",
                      LOOPD_REF(verify.epipolar_px)},
    Parameter<Config>{"verify.max_iterations", "samples", 10, 100'000,
                      "Bound of the random sampling.", LOOPD_REF(verify.max_iterations)},
    Parameter<Config>{"verify.min_inliers", "points + lines", 8, 10'000,
                      "Fewer, in distinct places, are no loop. On the real sequences measured no "
                      "false candidate has more than 30.",
                      LOOPD_REF(verify.min_inliers)},
    Parameter<Config>{
        "verify.min_agreement", "of all matches", 0, 1,
        "And at least this share of the matches must fit: look-alikes share parts of a "
        "view, the rest contradicts. Halves the false loops between mirrored rooms, "
        "costs 7 % recall where views overlap little.",
        LOOPD_REF(verify.min_agreement)},
    Parameter<Config>{"verify.seed", "", 0, 2'147'483'647,
                      "Seed of the random sampling: the same seed gives the same decisions.",
                      LOOPD_REF(verify.seed)},
};

#undef LOOPD_REF

std::string number_text(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return {text.data(), end};
}

std::string violation(const Parameter<Config>& parameter, double value) {
  const double bound = value < parameter.min ? parameter.min : parameter.max;
  const char* relation = value < parameter.min ? ">= " : "<= ";
  return std::string(parameter.key) + " = " + number_text(value) +
         ". Violated constraint: " + std::string(parameter.key) + " " + relation +
         number_text(bound);
}

double number_of(const ParameterRef& ref) {
  if (const auto* const* value = std::get_if<int*>(&ref)) return static_cast<double>(**value);
  if (const auto* const* value = std::get_if<double*>(&ref)) return **value;
  return **std::get_if<bool*>(&ref) ? 1.0 : 0.0;
}

}  // namespace

std::span<const Parameter<Config>> parameters() { return kParameters; }

std::vector<std::string> validate(const Config& config) {
  std::vector<std::string> violations;
  Config copy = config;
  for (const auto& parameter : kParameters) {
    const double value = number_of(parameter.ref(copy));
    if (!(value >= parameter.min && value <= parameter.max))  // catches NaN as well
      violations.push_back(violation(parameter, value));
  }
  if (violations.empty() && map_capacity(config).full_images < MapCapacity::kLeastImages)
    violations.push_back(
        "memory_budget_bytes = " + std::to_string(config.memory_budget_bytes) +
        ". Violated constraint: memory_budget_bytes >= " + std::to_string(least_map_bytes(config)) +
        ", a map of " + std::to_string(MapCapacity::kLeastImages) + " images");
  if (config.features.points == 0 && config.features.lines == 0)
    violations.push_back(
        "features.points = 0 and features.lines = 0. Violated constraint: one of them > 0");
  return violations;
}

}  // namespace loopd
