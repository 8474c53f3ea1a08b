#include "verify/line_matching.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "base/hamming.h"
#include "verify/rotation.h"
#include "verify/scene.h"

namespace loopd {
namespace {

using testing::flipped;
using testing::make_scene;
using testing::random_descriptor;
using testing::Scene;
using testing::SceneOptions;

std::vector<LineMatch> match(const Features& query, const Features& candidate,
                             std::optional<double> rotation_rad = std::nullopt,
                             const VerifyConfig& config = {}) {
  std::vector<LineMatch> out;
  LineMatcher().match(query, candidate, config, rotation_rad, out);
  return out;
}

std::vector<LineMatch> match_nndr(const Features& query, const Features& candidate,
                                  const VerifyConfig& config = {}) {
  std::vector<LineMatch> out;
  LineMatcher().match_nndr(query, candidate, config, std::nullopt, out);
  return out;
}

void add(Features& f, const Line& line, const Descriptor& d) {
  f.lines.push_back(line);
  f.line_descriptors.push_back(d);
}

// The obvious matcher: whole sorted lists, then filter, ratio test and claims, each on its own.
std::vector<LineMatch> slow_match(const Features& query, const Features& candidate,
                                  double rotation_rad, const VerifyConfig& config) {
  struct Entry {
    int distance;
    std::uint32_t line;
    double alpha;
  };
  const auto k = std::min(static_cast<std::size_t>(config.line_neighbours), candidate.lines.size());
  std::vector<std::vector<Entry>> survivors(query.lines.size());
  std::vector<int> reach(query.lines.size());
  for (std::size_t i = 0; i < query.lines.size(); ++i) {
    std::vector<Entry> all;
    for (std::uint32_t j = 0; j < candidate.lines.size(); ++j)
      all.push_back({hamming_distance(query.line_descriptors[i], candidate.line_descriptors[j]), j,
                     absolute_angle(*line_direction_rad(query.lines[i]) -
                                    *line_direction_rad(candidate.lines[j]) + rotation_rad)});
    std::stable_sort(all.begin(), all.end(),
                     [](const Entry& a, const Entry& b) { return a.distance < b.distance; });
    all.resize(k);
    reach[i] = all.back().distance;
    for (const Entry& e : all)
      if (e.alpha <= config.max_line_angle_deg * kPi / 180) survivors[i].push_back(e);
  }
  std::vector<LineMatch> out;
  for (std::uint32_t i = 0; i < query.lines.size(); ++i) {
    if (survivors[i].empty()) continue;
    const Entry& best = survivors[i][0];
    std::optional<int> second;
    if (survivors[i].size() > 1)
      second = survivors[i][1].distance;
    else if (k < candidate.lines.size())
      second = reach[i];
    const auto ratio = nndr(best.distance, second, config.line_ratio, config.max_line_distance);
    bool nearest = ratio.has_value();
    for (std::uint32_t other = 0; nearest && other < query.lines.size(); ++other)
      for (const Entry& e : survivors[other])
        if (e.line == best.line &&
            (e.distance < best.distance || (e.distance == best.distance && other < i)))
          nearest = false;
    if (!nearest) continue;
    LineMatch m;
    m.query = i;
    m.candidate = best.line;
    m.distance = static_cast<std::uint16_t>(best.distance);
    m.ratio = *ratio;
    m.flipped = best.alpha > kPi / 2;
    out.push_back(m);
  }
  return out;
}

TEST(LineMatcher, EqualsTheObviousMatcher) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SceneOptions options;
    options.points = 0;
    options.lines = 40;
    options.seed = seed;
    Scene scene = make_scene(options);
    // Few centres: many near lines, ties, and neighbours of the wrong direction.
    Random random(seed);
    std::vector<Descriptor> centres;
    for (int i = 0; i < 6; ++i) centres.push_back(random_descriptor(random));
    for (Features* f : {&scene.query, &scene.match})
      for (Descriptor& d : f->line_descriptors)
        d = flipped(centres[random.below(6)], static_cast<int>(random.below(30)), random);
    for (const double angle : {10.0, 60.0, 180.0}) {
      VerifyConfig config;
      config.max_line_angle_deg = angle;
      EXPECT_EQ(match(scene.query, scene.match, 0.2, config),
                slow_match(scene.query, scene.match, 0.2, config))
          << "seed " << seed << ", " << angle << " degrees";
    }
  }
}

TEST(LineMatcher, EveryRollIsMatchedStartToStart) {
  for (int degrees = 0; degrees < 360; degrees += 45) {
    SceneOptions options;
    options.points = 0;
    options.lines = 80;
    options.roll_rad = degrees * kPi / 180;
    const Scene scene = make_scene(options);
    // The made lines point everywhere: only their descriptors tell the rotation.
    const auto found = match(scene.query, scene.match);
    EXPECT_GE(found.size(), 76u) << degrees;
    for (const LineMatch& m : found) {
      EXPECT_EQ(m.candidate, scene.line_partner[m.query]);
      EXPECT_FALSE(m.flipped);
    }
  }
}

TEST(LineMatcher, OnePairingALineAndEachCandidateOnce) {
  SceneOptions options;
  options.outliers = 0.5;
  Scene scene = make_scene(options);
  // Broken lines: every query line twice.
  const std::size_t count = scene.query.lines.size();
  for (std::size_t i = 0; i < count; ++i)
    add(scene.query, scene.query.lines[i], scene.query.line_descriptors[i]);
  for (const auto& found :
       {match(scene.query, scene.match), match_nndr(scene.query, scene.match)}) {
    EXPECT_GE(found.size(), 55u);
    std::set<std::uint32_t> query, candidate;
    for (const LineMatch& m : found) {
      EXPECT_TRUE(query.insert(m.query).second);
      EXPECT_TRUE(candidate.insert(m.candidate).second);
      EXPECT_LT(m.query, count) << "of equals the first";
    }
  }
}

// The point of the paper's section 2.5.1: a look-alike of another direction spoils plain NNDR.
TEST(LineMatcher, DirectionResolvesLookAlikes) {
  SceneOptions options;
  options.points = 0;
  options.lines = 40;
  Scene scene = make_scene(options);
  Random random(7);
  for (std::size_t i = 0; i < 40; ++i) {
    const Line l = scene.match.lines[scene.line_partner[i]];
    const Line upright{l.start_x_px, l.start_y_px, l.start_x_px - (l.end_y_px - l.start_y_px),
                       l.start_y_px + (l.end_x_px - l.start_x_px)};
    add(scene.match, upright, flipped(scene.query.line_descriptors[i], 21, random));
  }
  EXPECT_GE(match(scene.query, scene.match, 0.0).size(), 36u);
  EXPECT_LE(match_nndr(scene.query, scene.match).size(), 4u);
}

TEST(LineMatcher, AFlippedLineIsPairedStartToEnd) {
  Features query, candidate;
  Random random(1);
  const Descriptor d = random_descriptor(random);
  add(query, {10, 10, 100, 12}, d);
  add(candidate, {110, 22, 20, 20}, d);
  VerifyConfig all;
  all.max_line_angle_deg = 180;
  const auto found = match(query, candidate, 0.0, all);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_TRUE(found[0].flipped);
  const auto turned = match(query, candidate, kPi, all);
  ASSERT_EQ(turned.size(), 1u);
  EXPECT_FALSE(turned[0].flipped);
}

TEST(LineMatcher, ALineWithoutLengthMatchesNothing) {
  Features query, candidate;
  Random random(1);
  const Descriptor d = random_descriptor(random);
  add(query, {10, 10, 10, 10}, d);
  add(candidate, {10, 10, 50, 10}, d);
  EXPECT_TRUE(match(query, candidate).empty());
  EXPECT_TRUE(match(candidate, query).empty());
  EXPECT_TRUE(match_nndr(query, candidate).empty());
}

TEST(LineMatcher, NoLines) {
  const Features none;
  const Scene scene = make_scene({});
  EXPECT_TRUE(match(none, scene.match).empty());
  EXPECT_TRUE(match(scene.query, none).empty());
  EXPECT_TRUE(match_nndr(none, none).empty());
}

TEST(LineMatcher, OneCandidateMustBeNearInItself) {
  Random random(2);
  const Descriptor d = random_descriptor(random);
  for (const int bits : {40, 41}) {
    Features query, candidate;
    add(query, {10, 10, 100, 12}, d);
    add(candidate, {20, 20, 110, 22}, flipped(d, bits, random));
    EXPECT_EQ(match(query, candidate, 0.0).size(), bits <= 40 ? 1u : 0u);
    EXPECT_EQ(match_nndr(query, candidate).size(), bits <= 40 ? 1u : 0u);
  }
}

}  // namespace
}  // namespace loopd
