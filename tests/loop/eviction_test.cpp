#include "loop/eviction.h"

#include <gtest/gtest.h>

#include <vector>

namespace loopd {
namespace {

/// Images that each changed by as much as given.
std::vector<MapImage> path(const std::vector<double>& changes) {
  std::vector<MapImage> images(changes.size());
  for (std::size_t i = 0; i < changes.size(); ++i) {
    images[i].id = static_cast<ImageId>(i);
    images[i].change = changes[i];
  }
  return images;
}

TEST(Eviction, FirstAndNewestStay) {
  EXPECT_EQ(least_worth({}), std::nullopt);
  EXPECT_EQ(least_worth(path({0})), std::nullopt);
  EXPECT_EQ(least_worth(path({0, 0})), std::nullopt);
  EXPECT_EQ(least_worth(path({0, 1, 0})), 1u);
}

TEST(Eviction, WhatItsNeighboursShowGoesFirst) {
  EXPECT_EQ(least_worth(path({0, 0.9, 0.9, 0.1, 0.1, 0.9, 0.9})), 3u);
}

TEST(Eviction, AnImageThatClosedALoopGoesBeforeOneThatShowsItsPlaceAlone) {
  auto images = path({0, 0.5, 0.5, 0.5, 0.5, 0.5});
  images[3].revisit = true;
  EXPECT_EQ(least_worth(images), 3u);
}

TEST(Eviction, AnImageThatLoopsFoundStays) {
  auto images = path({0, 0.5, 0.5, 0.5, 0.5});
  for (const std::size_t i : {1u, 3u}) images[i].revisits = 1;
  EXPECT_EQ(least_worth(images), 2u);
  EXPECT_GT(worth(images, 1), worth(images, 2));
}

TEST(Eviction, OfEqualImagesTheOldestGoes) {
  EXPECT_EQ(least_worth(path({0, 0.5, 0.5, 0.5, 0.5})), 1u);
}

TEST(Eviction, ThinsAPathEvenly) {
  auto images = path(std::vector<double>(101, 0.2));
  for (auto& image : images) image.revisits = 1;  // so that age plays no part
  while (images.size() > 26) {
    const auto gone = *least_worth(images);
    images[gone + 1].change += images[gone].change;
    images.erase(images.begin() + static_cast<std::ptrdiff_t>(gone));
  }
  for (std::size_t i = 1; i < images.size(); ++i)
    EXPECT_LE(images[i].id - images[i - 1].id, 8u) << "a gap in the path at " << images[i].id;
}

TEST(Eviction, TheOldPartOfAPathGetsThinnerButIsNotForgotten) {
  std::vector<MapImage> images;
  for (ImageId id = 0; id < 5000; ++id) {
    while (images.size() >= 100) {
      const auto gone = *least_worth(images);
      images[gone + 1].change += images[gone].change;
      images.erase(images.begin() + static_cast<std::ptrdiff_t>(gone));
    }
    images.emplace_back();
    images.back().id = id;
    images.back().change = 0.3;
  }
  for (std::size_t i = 1; i < images.size(); ++i)
    EXPECT_LE(images[i].id - images[i - 1].id, 400u) << "a gap in the path at " << images[i].id;
}

}  // namespace
}  // namespace loopd
