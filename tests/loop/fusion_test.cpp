#include "loop/fusion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

namespace loopd {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<ImageId> images_of(const std::vector<Candidate>& list) {
  std::vector<ImageId> images;
  for (const Candidate& c : list) images.push_back(c.image);
  return images;
}

std::vector<double> scores_of(const std::vector<Candidate>& list) {
  std::vector<double> scores;
  for (const Candidate& c : list) scores.push_back(c.score);
  return scores;
}

bool is_best_first(const std::vector<Candidate>& list) {
  return std::is_sorted(list.begin(), list.end(), [](const Candidate& a, const Candidate& b) {
    return a.score != b.score ? a.score > b.score : a.image < b.image;
  });
}

/// `length` images from `first_id` on, scores falling evenly from 1 to just above 0.
std::vector<Candidate> falling(std::size_t length, ImageId first_id) {
  std::vector<Candidate> list;
  for (std::size_t i = 0; i < length; ++i)
    list.push_back({first_id + static_cast<ImageId>(i),
                    static_cast<double>(length - i) / static_cast<double>(length)});
  return list;
}

std::vector<Candidate> fused(const std::vector<Candidate>& points,
                             const std::vector<Candidate>& lines, double penalty = 0.5) {
  std::vector<Candidate> result{{77, 7.0}};  // what was there before must go
  fuse(points, lines, penalty, result);
  return result;
}

// ---- Equation (1)

TEST(NormaliseScores, IsMinMaxOverTheWholeList) {
  std::vector<Candidate> list{{5, 10.0}, {2, 7.0}, {9, 4.0}, {1, 3.0}, {0, 2.0}};
  normalise_scores(list, 0.0, 64);
  EXPECT_THAT(images_of(list), ElementsAre(5, 2, 9, 1, 0));
  EXPECT_THAT(scores_of(list), ElementsAre(1.0, 5.0 / 8, 2.0 / 8, 1.0 / 8, 0.0));
}

TEST(NormaliseScores, DropsWhatIsBelowTheThresholdAndKeepsWhatIsOnIt) {
  std::vector<Candidate> list{{5, 10.0}, {2, 7.0}, {9, 4.0}, {1, 3.0}, {0, 2.0}};
  normalise_scores(list, 0.25, 64);
  EXPECT_THAT(images_of(list), ElementsAre(5, 2, 9));
}

TEST(NormaliseScores, CutsTheListAfterNormalising) {
  std::vector<Candidate> list{{5, 10.0}, {2, 7.0}, {9, 4.0}, {1, 2.0}};
  normalise_scores(list, 0.0, 2);
  EXPECT_THAT(images_of(list), ElementsAre(5, 2));
  EXPECT_THAT(scores_of(list), ElementsAre(1.0, 5.0 / 8));  // by the last of four, not of two
}

TEST(NormaliseScores, EqualScoresAreAllKeptWithOne) {
  for (const double score : {0.0, 1e-300, 3.5, 1e300}) {
    std::vector<Candidate> list{{3, score}, {4, score}, {8, score}};
    normalise_scores(list, 0.9, 64);
    EXPECT_THAT(images_of(list), ElementsAre(3, 4, 8));
    EXPECT_THAT(scores_of(list), ElementsAre(1.0, 1.0, 1.0)) << score;
  }
}

TEST(NormaliseScores, OneCandidateIsKeptAndNoneStaysNone) {
  std::vector<Candidate> one{{0, 0.0}};
  normalise_scores(one, 1.0, 1);
  EXPECT_THAT(images_of(one), ElementsAre(0));
  EXPECT_THAT(scores_of(one), ElementsAre(1.0));
  std::vector<Candidate> none;
  normalise_scores(none, 0.3, 64);
  EXPECT_THAT(none, IsEmpty());
}

TEST(NormaliseScores, NeverLeavesTheUnitInterval) {
  std::mt19937 random(1);
  for (int round = 0; round < 500; ++round) {
    std::vector<Candidate> list(1 + random() % 40);
    const double scale = std::ldexp(1.0, static_cast<int>(random() % 600U) - 300);
    for (std::size_t i = 0; i < list.size(); ++i)
      list[i] = {static_cast<ImageId>(i), static_cast<double>(random() % 8U) * scale};
    std::stable_sort(list.begin(), list.end(),
                     [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
    normalise_scores(list, 0.2, 64);
    ASSERT_FALSE(list.empty());
    EXPECT_EQ(list.front().score, 1.0);
    for (const Candidate& c : list) {
      EXPECT_GE(c.score, 0.2);  // false for NaN
      EXPECT_LE(c.score, 1.0);
    }
  }
}

// ---- Equations (2) and (3), votes divided by the length they were ranked in

TEST(Fuse, MergesByHandComputedVotes) {
  // c = 2. Image 1 is in both tops: b_p = (2 - 1) / 2 * 0.5, b_l = (2 - 0) / 2 * 1, their geometric
  // mean is 0.5. Images 2 and 7 only have points, ranked in 3; image 4 only lines, ranked in 2.
  const auto result = fused({{2, 1.0}, {1, 0.5}, {7, 0.25}}, {{1, 1.0}, {4, 0.5}}, /*penalty=*/0.5);
  EXPECT_THAT(images_of(result), ElementsAre(1, 2, 4, 7));  // 1 and 2 tie: by id
  EXPECT_THAT(scores_of(result),
              ElementsAre(0.5, 0.5 * 3 / 3 * 1.0, 0.5 * 1 / 2 * 0.5, 0.5 * (1.0 / 3) * 0.25));
}

TEST(Fuse, AnImageBeyondTheOtherListsLengthKeepsTheBetterOfItsVotes) {
  // c = 1: image 3 is the best of lines but second of points.
  const auto result = fused({{8, 1.0}, {3, 0.9}}, {{3, 1.0}}, 0.5);
  EXPECT_THAT(images_of(result), ElementsAre(3, 8));
  EXPECT_THAT(scores_of(result), ElementsAre(0.5, 0.5));
}

TEST(Fuse, AgreementOnTheBestGivesOne) {
  const auto result = fused({{0, 1.0}, {5, 0.5}}, {{0, 1.0}, {6, 0.5}}, 0.5);
  EXPECT_EQ(result.front().image, 0u);
  EXPECT_EQ(result.front().score, 1.0);
}

TEST(Fuse, AnEmptyListLeavesTheDecisionToTheOther) {
  const auto list = falling(50, 10);
  const auto by_points = fused(list, {}, 0.1);
  const auto by_lines = fused({}, list, 0.1);
  EXPECT_EQ(images_of(by_points), images_of(list));
  EXPECT_EQ(images_of(by_lines), images_of(list));
  EXPECT_EQ(scores_of(by_points), scores_of(by_lines));
  for (std::size_t i = 0; i < list.size(); ++i)  // unpenalised votes
    EXPECT_EQ(by_points[i].score, static_cast<double>(50 - i) / 50 * list[i].score);
  EXPECT_THAT(fused({}, {}), IsEmpty());
}

// Lengths 1 and 2 against 50, the short list on either side.
class ShortAgainstLong : public ::testing::TestWithParam<std::tuple<std::size_t, bool>> {
 protected:
  std::vector<Candidate> fuse_with(const std::vector<Candidate>& short_list,
                                   const std::vector<Candidate>& long_list) const {
    return std::get<1>(GetParam()) ? fused(short_list, long_list) : fused(long_list, short_list);
  }
};

TEST_P(ShortAgainstLong, NeitherSilencesTheOther) {
  const auto short_list = falling(std::get<0>(GetParam()), 1000);
  const auto long_list = falling(50, 10);
  const auto result = fuse_with(short_list, long_list);
  ASSERT_EQ(result.size(), short_list.size() + long_list.size());
  EXPECT_EQ(result[0].image, 10u);  // the best of each list, equal by score
  EXPECT_EQ(result[1].image, 1000u);
  EXPECT_EQ(result[0].score, 0.5);
  EXPECT_EQ(result[1].score, 0.5);
  // The long list keeps its order and the distances of its votes: ranked in 50, not in c.
  std::vector<Candidate> of_long;
  for (const Candidate& c : result)
    if (c.image < 1000) of_long.push_back(c);
  EXPECT_EQ(images_of(of_long), images_of(long_list));
  for (std::size_t i = 0; i < of_long.size(); ++i)
    EXPECT_EQ(of_long[i].score, 0.5 * (static_cast<double>(50 - i) / 50 * long_list[i].score));
}

TEST_P(ShortAgainstLong, AnImageInBothTopsComesFirst) {
  auto short_list = falling(std::get<0>(GetParam()), 1000);
  short_list[0].image = 10;
  const auto result = fuse_with(short_list, falling(50, 10));
  EXPECT_EQ(result.size(), short_list.size() + 49);
  EXPECT_EQ(result[0].image, 10u);
  EXPECT_EQ(result[0].score, 1.0);
}

INSTANTIATE_TEST_SUITE_P(Lengths, ShortAgainstLong,
                         ::testing::Combine(::testing::Values(1u, 2u), ::testing::Bool()));

// The same as its description says it, slow and obvious.
std::map<ImageId, double> obviously_fused(const std::vector<Candidate>& points,
                                          const std::vector<Candidate>& lines, double penalty) {
  const std::size_t c = std::min(points.size(), lines.size());
  const auto votes = [](const std::vector<Candidate>& list, std::size_t length) {
    std::map<ImageId, double> found;
    for (std::size_t i = 0; i < length; ++i)
      found[list[i].image] =
          static_cast<double>(length - i) / static_cast<double>(length) * list[i].score;
    return found;
  };
  const auto top_points = votes(points, c);
  const auto top_lines = votes(lines, c);
  std::map<ImageId, double> result;
  for (const auto* list : {&points, &lines})
    for (const auto& [image, vote] : votes(*list, list->size())) {
      const double own = (c == 0 ? 1.0 : penalty) * vote;
      result[image] = result.contains(image) ? std::max(result[image], own) : own;
    }
  for (const auto& [image, vote] : top_points)
    if (top_lines.contains(image)) result[image] = std::sqrt(vote * top_lines.at(image));
  return result;
}

/// A list as normalise_scores leaves it, with many ties, of images below `images`.
std::vector<Candidate> random_list(std::mt19937& random, std::size_t images) {
  std::vector<Candidate> list;
  for (ImageId image = 0; image < images; ++image)
    if (random() % 3 == 0) list.push_back({image, static_cast<double>(random() % 11U) / 10});
  std::stable_sort(list.begin(), list.end(),
                   [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
  return list;
}

TEST(Fuse, EqualsTheObviousWayOnRandomLists) {
  std::mt19937 random(2);
  for (int round = 0; round < 2000; ++round) {
    const auto points = random_list(random, random() % 40);
    const auto lines = random_list(random, random() % 40);
    const double penalty = static_cast<double>(random() % 5U) / 4;
    const auto result = fused(points, lines, penalty);
    const auto expected = obviously_fused(points, lines, penalty);
    ASSERT_EQ(result.size(), expected.size());  // no image lost or doubled
    ASSERT_TRUE(is_best_first(result));
    for (const Candidate& c : result) {
      ASSERT_TRUE(expected.contains(c.image)) << c.image;
      EXPECT_EQ(c.score, expected.at(c.image)) << c.image;
      EXPECT_GE(c.score, 0.0);
      EXPECT_LE(c.score, 1.0);
    }
  }
}

TEST(Fuse, IsTheSameWithPointsAndLinesSwapped) {
  std::mt19937 random(3);
  for (int round = 0; round < 200; ++round) {
    const auto a = random_list(random, 30);
    const auto b = random_list(random, 30);
    EXPECT_EQ(images_of(fused(a, b)), images_of(fused(b, a)));
    EXPECT_EQ(scores_of(fused(a, b)), scores_of(fused(b, a)));
  }
}

}  // namespace
}  // namespace loopd
