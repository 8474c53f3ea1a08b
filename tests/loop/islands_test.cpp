#include "loop/islands.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace loopd {
namespace {

std::vector<Island> build_islands(std::span<const PlacedCandidate> candidates, std::uint32_t gap) {
  IslandBuilder builder;
  std::vector<Island> islands{{7, 9, 8, 1.0}};  // must go
  builder.build(candidates, gap, islands);
  return islands;
}

using ::testing::ElementsAre;
using ::testing::IsEmpty;

/// Image ids have holes (evicted images), positions have none: image = 3 * position + 100.
constexpr ImageId image_at(std::uint32_t position) { return 3 * position + 100; }
constexpr std::uint32_t position_of(ImageId image) { return (image - 100) / 3; }

PlacedCandidate placed(std::uint32_t position, double score) {
  return {image_at(position), position, score};
}

std::vector<ImageId> firsts_of(const std::vector<Island>& islands) {
  std::vector<ImageId> firsts;
  for (const Island& island : islands) firsts.push_back(island.first);
  return firsts;
}

TEST(BuildIslands, OfNoCandidatesThereAreNone) { EXPECT_THAT(build_islands({}, 5), IsEmpty()); }

TEST(BuildIslands, OfOneCandidateIsThatImage) {
  const std::vector<PlacedCandidate> one{{0, 0, 0.25}};
  const auto islands = build_islands(one, 5);
  ASSERT_EQ(islands.size(), 1u);
  EXPECT_EQ(islands[0].first, 0u);
  EXPECT_EQ(islands[0].last, 0u);
  EXPECT_EQ(islands[0].best, 0u);
  EXPECT_EQ(islands[0].score, 0.25);
}

TEST(BuildIslands, ScoreIsTheMeanOverAllPositionsAndHolesCountZero) {
  // Positions 10, 12 and 13 of 10..13; 11 was not retrieved. Image ids are three apart, which must
  // not count: eviction leaves no holes.
  const std::vector<PlacedCandidate> candidates{placed(12, 1.0), placed(13, 0.5), placed(10, 0.25)};
  const auto islands = build_islands(candidates, 2);
  ASSERT_EQ(islands.size(), 1u);
  EXPECT_EQ(islands[0].first, image_at(10));
  EXPECT_EQ(islands[0].last, image_at(13));
  EXPECT_EQ(islands[0].best, image_at(12));
  EXPECT_EQ(islands[0].score, (1.0 + 0.5 + 0.25) / 4);  // Equation (4)
}

TEST(BuildIslands, SeparatesWhatIsFurtherThanTheGap) {
  const std::vector<PlacedCandidate> candidates{placed(10, 1.0), placed(13, 0.9), placed(20, 0.8)};
  EXPECT_EQ(build_islands(candidates, 3).size(), 2u);
  EXPECT_EQ(build_islands(candidates, 2).size(), 3u);
  EXPECT_EQ(build_islands(candidates, 10).size(), 1u);
}

TEST(BuildIslands, WithGapZeroEveryImageIsAnIsland) {
  const std::vector<PlacedCandidate> candidates{placed(4, 1.0), placed(5, 0.5), placed(3, 0.5)};
  const auto islands = build_islands(candidates, 0);
  EXPECT_THAT(firsts_of(islands), ElementsAre(image_at(4), image_at(3), image_at(5)));
}

TEST(BuildIslands, AnImageBetweenTwoSeedsJoinsTheNearer) {
  const std::vector<PlacedCandidate> candidates{placed(10, 1.0), placed(17, 0.9), placed(14, 0.5),
                                                placed(13, 0.25)};
  const auto islands = build_islands(candidates, 5);
  ASSERT_EQ(islands.size(), 2u);
  EXPECT_EQ(islands[0].first, image_at(14));  // (0.9 + 0.5) / 4
  EXPECT_EQ(islands[0].last, image_at(17));
  EXPECT_EQ(islands[1].first, image_at(10));  // (1 + 0.25) / 4
  EXPECT_EQ(islands[1].last, image_at(13));
}

TEST(BuildIslands, AnImageHalfwayJoinsTheBetterSeed) {
  const std::vector<PlacedCandidate> candidates{placed(20, 1.0), placed(14, 0.9), placed(17, 0.5)};
  const auto islands = build_islands(candidates, 5);
  ASSERT_EQ(islands.size(), 2u);
  EXPECT_THAT(firsts_of(islands), ElementsAre(image_at(14), image_at(17)));
  EXPECT_EQ(islands[0].last, image_at(14));
}

TEST(BuildIslands, TiesGoToTheOlder) {
  const std::vector<PlacedCandidate> candidates{placed(50, 0.5), placed(2, 0.5), placed(30, 0.5)};
  EXPECT_THAT(firsts_of(build_islands(candidates, 1)),
              ElementsAre(image_at(2), image_at(30), image_at(50)));
}

std::vector<PlacedCandidate> random_candidates(std::mt19937& random) {
  std::vector<PlacedCandidate> candidates;
  const auto one_in = 1 + random() % 6;
  for (std::uint32_t position = 0; position < 120; ++position)
    if (random() % one_in == 0)
      candidates.push_back(placed(position, static_cast<double>(random() % 50U) / 49));
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.score > b.score; });
  return candidates;
}

TEST(BuildIslands, NeverOverlapAndHoldEveryCandidateOnce) {
  std::mt19937 random(4);
  for (int round = 0; round < 1000; ++round) {
    const auto candidates = random_candidates(random);
    const auto gap = static_cast<std::uint32_t>(random() % 8);
    const auto islands = build_islands(candidates, gap);
    std::vector<int> holders(120, 0);
    for (const Island& island : islands) {
      const auto first = position_of(island.first);
      const auto last = position_of(island.last);
      ASSERT_LE(first, last);
      ASSERT_LE(last - first, 2 * gap);
      for (auto position = first; position <= last; ++position) ++holders[position];
    }
    EXPECT_THAT(holders, ::testing::Each(::testing::Le(1)));
    for (const auto& c : candidates) ASSERT_EQ(holders[c.position], 1) << c.position;
  }
}

// Score of an island by Equation (4), from all candidates.
double score_of(const Island& island, const std::vector<PlacedCandidate>& candidates) {
  double sum = 0;
  for (const auto& c : candidates)
    if (c.image >= island.first && c.image <= island.last) sum += c.score;
  return sum / (position_of(island.last) - position_of(island.first) + 1);
}

TEST(BuildIslands, ScoresAndOrderAreThoseOfTheDescription) {
  std::mt19937 random(5);
  for (int round = 0; round < 1000; ++round) {
    const auto candidates = random_candidates(random);
    const auto islands = build_islands(candidates, static_cast<std::uint32_t>(random() % 8));
    for (std::size_t i = 0; i < islands.size(); ++i) {
      EXPECT_DOUBLE_EQ(islands[i].score, score_of(islands[i], candidates));
      EXPECT_GE(islands[i].best, islands[i].first);
      EXPECT_LE(islands[i].best, islands[i].last);
      if (i == 0) continue;
      EXPECT_TRUE(
          islands[i - 1].score > islands[i].score ||
          (islands[i - 1].score == islands[i].score && islands[i - 1].first < islands[i].first));
    }
    if (candidates.empty()) continue;
    // The best candidate of all is a seed: the best image of the island that holds it.
    const auto holder = std::find_if(islands.begin(), islands.end(), [&](const Island& island) {
      return island.best == candidates.front().image;
    });
    EXPECT_NE(holder, islands.end());
  }
}

double score_of(ImageId image, const std::vector<PlacedCandidate>& candidates) {
  const auto it = std::find_if(candidates.begin(), candidates.end(),
                               [&](const auto& c) { return c.image == image; });
  return it == candidates.end() ? -1.0 : it->score;
}

TEST(BuildIslands, BestImageHasTheHighestScoreOfItsIsland) {
  std::mt19937 random(6);
  for (int round = 0; round < 1000; ++round) {
    const auto candidates = random_candidates(random);
    for (const Island& island : build_islands(candidates, static_cast<std::uint32_t>(random() % 8)))
      for (const auto& c : candidates)
        if (c.image >= island.first && c.image <= island.last) {
          ASSERT_LE(c.score, score_of(island.best, candidates));
        }
  }
}

// ---- Priority

std::vector<Island> four_islands() {
  return {{40, 45, 42, 0.9}, {10, 15, 12, 0.8}, {60, 66, 61, 0.7}, {20, 29, 25, 0.6}};
}

TEST(PreferIsland, WithoutPriorityNothingMoves) {
  auto islands = four_islands();
  prefer_island(islands, std::nullopt);
  EXPECT_THAT(firsts_of(islands), ElementsAre(40, 10, 60, 20));
}

TEST(PreferIsland, OverlappingOnesComeFirstInTheirOrder) {
  auto islands = four_islands();
  prefer_island(islands, Island{15, 20, 17, 0.1});  // touches 10..15 and 20..29
  EXPECT_THAT(firsts_of(islands), ElementsAre(10, 20, 40, 60));
}

TEST(PreferIsland, OneThatOverlapsNoneMovesNothing) {
  auto islands = four_islands();
  prefer_island(islands, Island{46, 59, 50, 1.0});
  EXPECT_THAT(firsts_of(islands), ElementsAre(40, 10, 60, 20));
}

TEST(PreferIsland, OneThatHoldsAnotherOverlapsIt) {
  for (const Island& priority : {Island{62, 63, 62, 1.0}, Island{50, 99, 80, 1.0}}) {
    auto islands = four_islands();
    prefer_island(islands, priority);
    EXPECT_THAT(firsts_of(islands), ElementsAre(60, 40, 10, 20));
  }
}

TEST(PreferIsland, NoIslandsStayNone) {
  std::vector<Island> islands;
  prefer_island(islands, Island{0, 0, 0, 1.0});
  EXPECT_THAT(islands, IsEmpty());
}

}  // namespace
}  // namespace loopd
