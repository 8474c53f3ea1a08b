#include "loop/map.h"

#include <gtest/gtest.h>

namespace loopd {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

LoopConfig waiting(int frames, double seconds) {
  LoopConfig config;
  config.waiting_frames = frames;
  config.waiting_s = seconds;
  return config;
}

/// An image with a few features, taken when the clock showed `frames` and `ns`.
MapImage image(ImageId id, std::int64_t frames, std::int64_t ns = 0,
               std::optional<std::int64_t> time_ns = std::nullopt) {
  MapImage made;
  made.id = id;
  made.sequence = 10 * id;
  made.time_ns = time_ns;
  made.taken = {frames, ns};
  made.features.points.resize(10);
  made.features.point_descriptors.resize(10);
  return made;
}

TEST(ImageMap, IsEmptyAtFirst) {
  const ImageMap map(waiting(3, 0));
  EXPECT_EQ(map.searchable(), 0u);
  EXPECT_EQ(map.newest(), nullptr);
  EXPECT_EQ(map.find(0), nullptr);
  EXPECT_EQ(map.ready({1'000'000, 1'000'000 * kSecond}), nullptr);
  EXPECT_EQ(map.bytes(), 0u);
}

TEST(ImageMap, HoldsAnImageBackForTheGivenNumberOfFrames) {
  ImageMap map(waiting(3, 0));
  map.push(image(0, 1));
  map.push(image(1, 2));
  EXPECT_EQ(map.ready({2, 0}), nullptr);
  EXPECT_EQ(map.ready({3, 0}), nullptr);
  ASSERT_NE(map.ready({4, 0}), nullptr);
  EXPECT_EQ(map.ready({4, 0})->id, 0u);
}

TEST(ImageMap, HoldsAnImageBackForTheGivenTimeWhereTimesAreKnown) {
  ImageMap map(waiting(1, 15.0));
  map.push(image(0, 1, 2 * kSecond, 1000 * kSecond));
  map.push(image(1, 2, 3 * kSecond, 1001 * kSecond));
  EXPECT_EQ(map.ready({100, 17 * kSecond - 1}), nullptr);
  EXPECT_NE(map.ready({100, 17 * kSecond}), nullptr);
}

TEST(ImageMap, WantsBothFramesAndTime) {
  ImageMap map(waiting(10, 5.0));
  map.push(image(0, 1, 0, 0));
  map.push(image(1, 2, 1, 1));
  EXPECT_EQ(map.ready({11, 5 * kSecond - 1}), nullptr);
  EXPECT_EQ(map.ready({10, 5 * kSecond}), nullptr);
  EXPECT_NE(map.ready({11, 5 * kSecond}), nullptr);
}

TEST(ImageMap, CountsFramesAloneWhereTimesAreUnknown) {
  ImageMap map(waiting(2, 15.0));
  map.push(image(0, 1));
  map.push(image(1, 2));
  EXPECT_NE(map.ready({3, 0}), nullptr);
}

TEST(ImageMap, NeverAdmitsTheNewestImageKept) {
  ImageMap map(waiting(1, 0));
  map.push(image(0, 1));
  EXPECT_EQ(map.ready({1000, 0}), nullptr);
  map.push(image(1, 1000));
  EXPECT_NE(map.ready({1001, 0}), nullptr);
}

TEST(ImageMap, AdmitsTheOldestFirst) {
  ImageMap map(waiting(2, 0));
  for (ImageId id = 0; id < 5; ++id) map.push(image(id, id));
  for (ImageId id = 0; id < 3; ++id) {
    ASSERT_NE(map.ready({4, 0}), nullptr);
    EXPECT_EQ(map.ready({4, 0})->id, id);
    map.admit();
    EXPECT_EQ(map.searchable(), id + 1u);
  }
  EXPECT_EQ(map.ready({4, 0}), nullptr);
}

TEST(ImageMap, FindsOnlyWhatIsSearchable) {
  ImageMap map(waiting(1, 0));
  for (const ImageId id : {0u, 3u, 4u, 9u}) map.push(image(id, id));
  for (int i = 0; i < 3; ++i) map.admit();
  for (const ImageId id : {0u, 3u, 4u}) {
    ASSERT_NE(map.find(id), nullptr);
    EXPECT_EQ(map.find(id)->id, id);
    EXPECT_EQ(map.find(id)->sequence, 10 * id);
  }
  for (const ImageId id : {1u, 2u, 5u, 9u, 10u, ~0u}) EXPECT_EQ(map.find(id), nullptr) << id;
}

TEST(ImageMap, PositionsHaveNoHoles) {
  ImageMap map(waiting(1, 0));
  const std::vector<ImageId> ids{0, 3, 4, 9, 1000};
  for (const ImageId id : ids) {
    map.push(image(id, id));
    map.admit();
  }
  for (std::uint32_t position = 0; position < ids.size(); ++position) {
    EXPECT_EQ(map.position(ids[position]), position);
    EXPECT_EQ(map.at(position).id, ids[position]);
  }
}

TEST(ImageMap, NewestIsWaitingOrElseTheLastAdmitted) {
  ImageMap map(waiting(1, 0));
  map.push(image(7, 1));
  map.push(image(8, 2));
  EXPECT_EQ(map.newest()->id, 8u);
  map.admit();
  EXPECT_EQ(map.newest()->id, 8u);
  map.admit();
  EXPECT_EQ(map.newest()->id, 8u);
}

TEST(ImageMap, AnImageStaysWhereItIsWhileOthersCome) {
  ImageMap map(waiting(1, 0));
  map.push(image(0, 0));
  map.admit();
  const MapImage* first = map.find(0);
  for (ImageId id = 1; id < 2000; ++id) {
    map.push(image(id, id));
    map.admit();
  }
  EXPECT_EQ(map.find(0), first);
}

TEST(ImageMap, BytesGrowByEveryImageAndNotByAdmission) {
  ImageMap map(waiting(1, 0));
  constexpr std::size_t kContent = 10 * (sizeof(Point) + sizeof(Descriptor));
  std::size_t before = 0;
  for (ImageId id = 0; id < 20; ++id) {
    map.push(image(id, id));
    EXPECT_GE(map.bytes(), before + kContent);
    EXPECT_LE(map.bytes(), before + kContent + 1000);
    before = map.bytes();
    if (id % 2 == 0) map.admit();
    EXPECT_EQ(map.bytes(), before);
  }
}

}  // namespace
}  // namespace loopd
