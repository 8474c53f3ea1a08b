#include "verify/point_matching.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "base/hamming.h"
#include "verify/scene.h"

namespace loopd {
namespace {

using testing::flipped;
using testing::random_descriptor;

// The obvious matcher: for every query the whole list, then for every match the whole column.
std::vector<FeatureMatch> slow_match(const std::vector<Descriptor>& query,
                                     const std::vector<Descriptor>& candidate,
                                     const VerifyConfig& config) {
  std::vector<FeatureMatch> out;
  std::set<std::uint32_t> used;
  for (std::uint32_t i = 0; i < query.size(); ++i) {
    int best = 1000, second = 1000;
    std::uint32_t nearest = 0;
    for (std::uint32_t j = 0; j < candidate.size(); ++j) {
      const int d = hamming_distance(query[i], candidate[j]);
      if (d < best) {
        second = best;
        best = d;
        nearest = j;
      } else if (d < second) {
        second = d;
      }
    }
    if (candidate.empty() || best > config.max_point_distance) continue;
    if (candidate.size() == 1 && best > config.max_point_distance / 2) continue;
    if (candidate.size() > 1 && (second == 0 || best > config.point_ratio * second)) continue;
    bool mutual = true;
    for (const Descriptor& other : query)
      mutual &= hamming_distance(other, candidate[nearest]) >= best;
    if (!mutual || !used.insert(nearest).second) continue;
    const double ratio = candidate.size() > 1
                             ? static_cast<double>(best) / second
                             : static_cast<double>(best) / config.max_point_distance;
    out.push_back({i, nearest, static_cast<std::uint16_t>(best), ratio});
  }
  return out;
}

std::vector<FeatureMatch> fast_match(const std::vector<Descriptor>& query,
                                     const std::vector<Descriptor>& candidate,
                                     const VerifyConfig& config = {}) {
  std::vector<FeatureMatch> out;
  PointMatcher().match(query, candidate, config, out);
  return out;
}

// Descriptors drawn around a few centres, so that near ones, equal ones and ties abound.
std::vector<Descriptor> clustered(std::size_t count, Random& random,
                                  const std::vector<Descriptor>& centres) {
  std::vector<Descriptor> out;
  for (std::size_t i = 0; i < count; ++i)
    out.push_back(
        flipped(centres[random.below(centres.size())], static_cast<int>(random.below(40)), random));
  return out;
}

TEST(PointMatcher, EqualsTheObviousMatcher) {
  Random random(1);
  PointMatcher matcher;
  std::vector<FeatureMatch> found;
  for (const std::size_t sizes : {0, 1, 2, 3, 15, 16, 17, 33, 100}) {
    for (const std::size_t centre_count : {1, 5, 60}) {
      std::vector<Descriptor> centres;
      for (std::size_t i = 0; i < centre_count; ++i) centres.push_back(random_descriptor(random));
      const auto query = clustered(sizes, random, centres);
      const auto candidate = clustered(sizes + random.below(5), random, centres);
      for (const double ratio : {0.7, 0.9, 1.0}) {
        VerifyConfig config;
        config.point_ratio = ratio;
        matcher.match(query, candidate, config, found);
        EXPECT_EQ(found, slow_match(query, candidate, config))
            << sizes << " points, " << centre_count << " centres, ratio " << ratio;
      }
    }
  }
}

TEST(PointMatcher, EachCandidateIsUsedOnce) {
  Random random(2);
  const Descriptor d = random_descriptor(random);
  const std::vector<Descriptor> candidate{d, random_descriptor(random)};
  const std::vector<Descriptor> query{flipped(d, 10, random), flipped(d, 5, random),
                                      flipped(d, 5, random)};
  const auto found = fast_match(query, candidate);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].query, 1u) << "the nearest, and of equals the first";
  EXPECT_EQ(found[0].distance, 5);
}

TEST(PointMatcher, ASingleCandidateMustBeNearInItself) {
  Random random(3);
  const Descriptor d = random_descriptor(random);
  EXPECT_EQ(fast_match({flipped(d, 32, random)}, {d}).size(), 1u);
  EXPECT_EQ(fast_match({flipped(d, 33, random)}, {d}).size(), 0u);
}

TEST(PointMatcher, TwoEqualCandidatesAreAmbiguous) {
  Random random(4);
  const Descriptor d = random_descriptor(random);
  EXPECT_TRUE(fast_match({d}, {d, d}).empty());
  EXPECT_TRUE(fast_match({flipped(d, 3, random)}, {d, d}).empty());
}

TEST(PointMatcher, AnIdenticalOneMatchesBesideANearOne) {
  Random random(5);
  const Descriptor d = random_descriptor(random);
  const auto found = fast_match({d}, {flipped(d, 2, random), d});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].candidate, 1u);
  EXPECT_EQ(found[0].ratio, 0);
}

TEST(Nndr, Rule) {
  EXPECT_TRUE(nndr(40, 50, 0.8, 64).has_value());
  EXPECT_FALSE(nndr(41, 50, 0.8, 64).has_value());
  EXPECT_FALSE(nndr(65, 256, 0.8, 64).has_value());
  EXPECT_FALSE(nndr(0, 0, 0.8, 64).has_value());
  EXPECT_TRUE(nndr(0, 1, 0.8, 64).has_value());
  EXPECT_TRUE(nndr(0, std::nullopt, 0.8, 0).has_value());
  EXPECT_FALSE(nndr(33, std::nullopt, 0.8, 64).has_value());
}

}  // namespace
}  // namespace loopd
