#include "features/corner_selection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "support/scene_image.h"

namespace loopd {
namespace {

using testing::Image;
using testing::wall_image;
using testing::with_noise;

double reference_harris(const Image& image, int x, int y) {
  double xx = 0, yy = 0, xy = 0;
  const auto at = [&](int px, int py) { return static_cast<double>(image.at(px, py)); };
  for (int cy = y - 3; cy <= y + 3; ++cy)
    for (int cx = x - 3; cx <= x + 3; ++cx) {
      double dx = 0, dy = 0;
      for (int i = -1; i <= 1; ++i) {
        const int weight = i == 0 ? 2 : 1;
        dx += weight * (at(cx + 1, cy + i) - at(cx - 1, cy + i));
        dy += weight * (at(cx + i, cy + 1) - at(cx + i, cy - 1));
      }
      xx += dx * dx;
      yy += dy * dy;
      xy += dx * dy;
    }
  return std::max(0.0, 25 * (xx * yy - xy * xy) - (xx + yy) * (xx + yy));
}

TEST(ScoreByHarris, IsTheMeasureInEveryForm) {
  Image hardest(60, 60);  // the largest gradients that can be
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 60; ++x) hardest.at(x, y) = (x / 2 + y / 2) % 2 != 0 ? 255 : 0;
  for (const Image& image : {with_noise(wall_image(1, 0, 60, 60), 10, 1), hardest, Image(60, 60)})
    for (const SimdForm form : simd_forms()) {
      std::vector<Corner> corners;
      for (int y = 6; y < 54; ++y)
        for (int x = 6; x < 54; ++x) corners.push_back({x, y, 0});
      score_by_harris(form, image.view(), corners);
      for (const Corner& c : corners) {
        const double expected = reference_harris(image, c.x_px, c.y_px);
        ASSERT_EQ(c.score, static_cast<float>(expected)) << c.x_px << "," << c.y_px;
      }
    }
}

// The rule, step by step, with whole sorts.
std::vector<Corner> reference_selection(std::size_t keep, const std::vector<Corner>& corners) {
  if (corners.size() <= keep) return corners;
  std::map<std::pair<int, int>, std::vector<std::size_t>> cells;
  const auto better = [&](std::size_t a, std::size_t b) {
    return corners[a].score != corners[b].score ? corners[a].score > corners[b].score : a < b;
  };
  for (std::size_t i = 0; i < corners.size(); ++i)
    cells[{corners[i].y_px / CornerSelection::kCellPx, corners[i].x_px / CornerSelection::kCellPx}]
        .push_back(i);
  std::size_t cap = 1;
  const auto left_by = [&] {
    std::size_t left = 0;
    for (const auto& [cell, members] : cells) left += std::min(cap, members.size());
    return left;
  };
  while (left_by() < keep) ++cap;
  std::vector<std::size_t> left;
  for (auto& [cell, members] : cells) {
    std::sort(members.begin(), members.end(), better);
    const std::size_t stay = std::min(CornerSelection::kCapFactor * cap, members.size());
    for (std::size_t i = 0; i < stay; ++i) left.push_back(members[i]);
  }
  std::sort(left.begin(), left.end(), better);
  left.resize(std::min(left.size(), keep));
  std::sort(left.begin(), left.end());
  std::vector<Corner> kept;
  for (const std::size_t i : left) kept.push_back(corners[i]);
  return kept;
}

std::vector<Corner> random_corners(std::size_t count, int reach_px, int scores, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<Corner> corners(count);
  for (Corner& c : corners)
    c = {static_cast<int>(random() % static_cast<unsigned>(reach_px)),
         static_cast<int>(random() % static_cast<unsigned>(reach_px)),
         static_cast<float>(random() % static_cast<unsigned>(scores))};
  return corners;
}

TEST(CornerSelection, FollowsItsRule) {
  CornerSelection selection;
  for (unsigned seed = 0; seed < 40; ++seed)
    for (const std::size_t keep : {0U, 1U, 7U, 100U, 500U, 5000U}) {
      const std::vector<Corner> corners =
          random_corners(1 + seed * 37, seed % 2 == 0 ? 20 : 700, seed % 3 == 0 ? 3 : 100000, seed);
      std::vector<Corner> kept = corners;
      selection.select(keep, kept);
      const std::vector<Corner> expected = reference_selection(keep, corners);
      ASSERT_EQ(kept.size(), expected.size()) << "seed " << seed << ", keep " << keep;
      for (std::size_t i = 0; i < kept.size(); ++i) {
        ASSERT_EQ(kept[i].x_px, expected[i].x_px);
        ASSERT_EQ(kept[i].y_px, expected[i].y_px);
        ASSERT_EQ(kept[i].score, expected[i].score);
      }
    }
}

TEST(CornerSelection, AClutteredPartDoesNotTakeAllPlaces) {
  std::vector<Corner> corners = random_corners(2000, 32, 1000, 1);  // one cell, strong
  for (Corner& c : corners) c.score += 1000;
  for (const Corner& weak : random_corners(500, 640, 100, 2)) corners.push_back(weak);
  CornerSelection().select(400, corners);
  ASSERT_EQ(corners.size(), 400U);
  const auto weak =
      std::count_if(corners.begin(), corners.end(), [](const Corner& c) { return c.score < 1000; });
  EXPECT_GE(weak, 380);
}

}  // namespace
}  // namespace loopd
