#pragma once

#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "loopd/detector.h"
#include "support/scene_image.h"

namespace loopd::testing {

/// A config for small images, with everything set that a test depends on: tuning the defaults must
/// not change what is tested. Words never leave the vocabulary, since the places seen here share
/// nothing with their neighbours.
inline Config small_config() {
  Config config;
  config.features.points = 300;
  config.features.lines = 100;
  config.features.max_pixels = 1'000'000;
  config.features.fast_threshold = 12;
  config.features.scale_factor = 1.2;
  config.features.levels = 4;
  config.features.min_line_length = 0.03;
  config.features.min_features = 20;
  config.index.word_ratio = 0.8;
  config.index.max_word_distance = 64;
  config.index.probation_images = 0;
  config.loop.waiting_frames = 5;
  config.loop.waiting_s = 0;
  config.loop.min_similarity = 0.3;
  config.loop.one_list_penalty = 0.5;
  config.loop.max_candidates = 20;
  config.loop.island_gap = 2;
  config.loop.verified_islands = 2;
  config.loop.verified_images = 1;
  config.loop.still_fraction = 0.75;
  config.loop.still_radius_px = 1.0;
  config.verify.point_ratio = 0.8;
  config.verify.line_ratio = 0.9;
  config.verify.epipolar_px = 2.0;
  config.verify.max_iterations = 200;
  config.verify.min_inliers = 20;
  config.verify.min_agreement = 0.3;
  config.verify.seed = 1;
  return config;
}

/// Everything a report says but times, as text: doubles exactly. `with_bytes` false leaves out the
/// memory held.
inline std::string text_of(const Report& r, bool with_bytes = true) {
  std::ostringstream out;
  out << std::hexfloat << "query " << r.query << " sequence " << r.sequence << " time "
      << (r.time_ns ? std::to_string(*r.time_ns) : "none") << ' ' << outcome_name(r.outcome)
      << (r.still ? " still" : "") << " points " << r.points << " lines " << r.lines;
  for (const auto* list : {&r.point_candidates, &r.line_candidates, &r.fused}) {
    out << "\nlist";
    for (const Candidate& c : *list) out << ' ' << c.image << ':' << c.score;
  }
  if (r.island)
    out << "\nisland " << r.island->first << ' ' << r.island->last << ' ' << r.island->best << ' '
        << r.island->score;
  if (r.match)
    out << "\nmatch " << r.match->image << ' ' << r.match->sequence << ' '
        << (r.match->time_ns ? std::to_string(*r.match->time_ns) : "none") << ' '
        << r.match->similarity;
  if (r.verification) {
    const Verification& v = *r.verification;
    out << "\nverification " << v.point_matches << ' ' << v.line_matches << ' ' << v.point_inliers
        << ' ' << v.line_inliers << ' ' << model_name(v.model) << ' ' << v.homography_inliers << ' '
        << v.cells << ' ' << v.spread_inliers;
    for (const double f : v.fundamental) out << ' ' << f;
    for (const double h : v.homography) out << ' ' << h;
  }
  out << "\npairs";
  for (const InlierPair& p : r.pairs)
    out << ' ' << p.query_x_px << ',' << p.query_y_px << ',' << p.match_x_px << ',' << p.match_y_px
        << (p.is_line ? 'l' : 'p');
  out << "\nwords " << r.words_points << ' ' << r.words_lines << " images " << r.images;
  if (with_bytes) out << " bytes " << r.bytes;
  return out.str();
}

/// A detector with its report.
class TestRun {
 public:
  explicit TestRun(const Config& config, LaneExecutor* lanes = nullptr)
      : detector(config, lanes), report_(std::make_unique<Report>()) {}

  /// process() of the next frame.
  const Report& decide(const Image& image, std::optional<std::int64_t> time_ns = std::nullopt) {
    detector.process(image.frame(sequence_++, time_ns), *report_);
    return *report_;
  }
  const Report& decide(const Features& features,
                       std::optional<std::int64_t> time_ns = std::nullopt) {
    detector.process(features, sequence_++, time_ns, *report_);
    return *report_;
  }
  const Report& absorb() {
    detector.absorb(*report_);
    return *report_;
  }
  /// Both.
  const Report& see(const auto& seen, std::optional<std::int64_t> time_ns = std::nullopt) {
    decide(seen, time_ns);
    return absorb();
  }
  Report& report() { return *report_; }

  Detector detector;

 private:
  std::unique_ptr<Report> report_;  // large
  std::uint64_t sequence_ = 0;
};

/// One view of a walk: which wall, and how far along it.
struct View {
  unsigned wall = 0;
  int offset_px = 0;
};

/// A walk past walls that share nothing; every wall is seen once, twice or three times in a row,
/// each view overlapping the one before by most of its width.
inline std::vector<View> walk(int views) {
  std::vector<View> lap;
  for (unsigned wall = 0; static_cast<int>(lap.size()) < views; ++wall)
    for (int i = 0; i <= static_cast<int>(wall % 3U); ++i) lap.push_back({1000 + wall, 40 * i});
  lap.resize(static_cast<std::size_t>(views));
  return lap;
}

/// Images of `laps` walks: from the second on a few pixels beside the first, all with noise of
/// their own.
inline std::vector<Image> laps_of(const std::vector<View>& lap, int laps, int width = 240,
                                  int height = 180) {
  std::vector<Image> images;
  for (int i = 0; i < laps; ++i)
    for (const View& view : lap)
      images.push_back(with_noise(wall_image(view.wall, view.offset_px + 3 * i, width, height), 3,
                                  static_cast<unsigned>(images.size() + 1)));
  return images;
}

}  // namespace loopd::testing
