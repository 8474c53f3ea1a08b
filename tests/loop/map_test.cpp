#include "loop/map.h"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

#include "support/descriptor_samples.h"

namespace loopd {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

LoopConfig waiting(int frames, double seconds) {
  LoopConfig config;
  config.waiting_frames = frames;
  config.waiting_s = seconds;
  return config;
}

/// An image taken when the clock showed `frames` and `ns`.
MapImage image(ImageId id, std::int64_t frames, std::int64_t ns = 0,
               std::optional<std::int64_t> time_ns = std::nullopt) {
  MapImage made;
  made.id = id;
  made.sequence = 10 * id;
  made.time_ns = time_ns;
  made.taken = {frames, ns};
  return made;
}

/// Features of random content.
Features features(std::size_t points, std::size_t lines, std::uint64_t seed = 1) {
  DescriptorSamples samples(seed);
  const auto random = [&] { return static_cast<float>(samples.below(1000)); };
  Features made;
  made.width_px = 640;
  made.height_px = 480;
  for (std::size_t i = 0; i < points; ++i) {
    made.points.push_back({random(), random(), random(), random()});
    made.point_descriptors.push_back(samples.independent());
  }
  for (std::size_t i = 0; i < lines; ++i) {
    made.lines.push_back({random(), random(), random(), random()});
    made.line_descriptors.push_back(samples.independent());
  }
  return made;
}

const Features kFew = features(10, 3);

/// A map with room for 3000 images of few features.
ImageMap map_of(const LoopConfig& config) { return ImageMap(config, 3000, 3000); }

/// A map of `n` searchable images, 0, 10, 20 ..., each of which changed by 1 + its position.
ImageMap searchable_map(ImageId n) {
  ImageMap map = map_of(waiting(1, 0));
  for (ImageId i = 0; i < n; ++i) {
    map.push(image(10 * i, i), kFew);
    map.admit(1.0 + i);
  }
  return map;
}

void expect_equal(const Features& one, const Features& two) {
  EXPECT_EQ(one.width_px, two.width_px);
  EXPECT_EQ(one.height_px, two.height_px);
  EXPECT_EQ(one.point_descriptors, two.point_descriptors);
  EXPECT_EQ(one.line_descriptors, two.line_descriptors);
  ASSERT_EQ(one.points.size(), two.points.size());
  for (std::size_t i = 0; i < one.points.size(); ++i) {
    EXPECT_EQ(one.points[i].x_px, two.points[i].x_px);
    EXPECT_EQ(one.points[i].angle_deg, two.points[i].angle_deg);
  }
  ASSERT_EQ(one.lines.size(), two.lines.size());
  for (std::size_t i = 0; i < one.lines.size(); ++i) {
    EXPECT_EQ(one.lines[i].start_x_px, two.lines[i].start_x_px);
    EXPECT_EQ(one.lines[i].end_y_px, two.lines[i].end_y_px);
  }
}

TEST(ImageMap, IsEmptyAtFirst) {
  const ImageMap map = map_of(waiting(3, 0));
  EXPECT_EQ(map.searchable(), 0u);
  EXPECT_EQ(map.newest(), nullptr);
  EXPECT_EQ(map.find(0), nullptr);
  EXPECT_EQ(map.ready({1'000'000, 1'000'000 * kSecond}), nullptr);
  EXPECT_EQ(map.bytes_in_use(), 0u);
}

TEST(ImageMap, HoldsAnImageBackForTheGivenNumberOfFrames) {
  ImageMap map = map_of(waiting(3, 0));
  map.push(image(0, 1), kFew);
  map.push(image(1, 2), kFew);
  EXPECT_EQ(map.ready({2, 0}), nullptr);
  EXPECT_EQ(map.ready({3, 0}), nullptr);
  ASSERT_NE(map.ready({4, 0}), nullptr);
  EXPECT_EQ(map.ready({4, 0})->id, 0u);
}

TEST(ImageMap, HoldsAnImageBackForTheGivenTimeWhereTimesAreKnown) {
  ImageMap map = map_of(waiting(1, 15.0));
  map.push(image(0, 1, 2 * kSecond, 1000 * kSecond), kFew);
  map.push(image(1, 2, 3 * kSecond, 1001 * kSecond), kFew);
  EXPECT_EQ(map.ready({100, 17 * kSecond - 1}), nullptr);
  EXPECT_NE(map.ready({100, 17 * kSecond}), nullptr);
}

TEST(ImageMap, WantsBothFramesAndTime) {
  ImageMap map = map_of(waiting(10, 5.0));
  map.push(image(0, 1, 0, 0), kFew);
  map.push(image(1, 2, 1, 1), kFew);
  EXPECT_EQ(map.ready({11, 5 * kSecond - 1}), nullptr);
  EXPECT_EQ(map.ready({10, 5 * kSecond}), nullptr);
  EXPECT_NE(map.ready({11, 5 * kSecond}), nullptr);
}

TEST(ImageMap, CountsFramesAloneWhereTimesAreUnknown) {
  ImageMap map = map_of(waiting(2, 15.0));
  map.push(image(0, 1), kFew);
  map.push(image(1, 2), kFew);
  EXPECT_NE(map.ready({3, 0}), nullptr);
}

TEST(ImageMap, NeverAdmitsTheNewestImageKept) {
  ImageMap map = map_of(waiting(1, 0));
  map.push(image(0, 1), kFew);
  EXPECT_EQ(map.ready({1000, 0}), nullptr);
  map.push(image(1, 1000), kFew);
  EXPECT_NE(map.ready({1001, 0}), nullptr);
}

TEST(ImageMap, AdmitsTheOldestFirst) {
  ImageMap map = map_of(waiting(2, 0));
  for (ImageId id = 0; id < 5; ++id) map.push(image(id, id), kFew);
  for (ImageId id = 0; id < 3; ++id) {
    ASSERT_NE(map.ready({4, 0}), nullptr);
    EXPECT_EQ(map.ready({4, 0})->id, id);
    map.admit(1);
    EXPECT_EQ(map.searchable(), id + 1u);
  }
  EXPECT_EQ(map.ready({4, 0}), nullptr);
}

TEST(ImageMap, FindsOnlyWhatIsSearchable) {
  ImageMap map = map_of(waiting(1, 0));
  for (const ImageId id : {0u, 3u, 4u, 9u}) map.push(image(id, id), kFew);
  for (int i = 0; i < 3; ++i) map.admit(1);
  for (const ImageId id : {0u, 3u, 4u}) {
    ASSERT_NE(map.find(id), nullptr);
    EXPECT_EQ(map.find(id)->id, id);
    EXPECT_EQ(map.find(id)->sequence, 10 * id);
  }
  for (const ImageId id : {1u, 2u, 5u, 9u, 10u, ~0u}) EXPECT_EQ(map.find(id), nullptr) << id;
}

TEST(ImageMap, PositionsHaveNoHoles) {
  ImageMap map = map_of(waiting(1, 0));
  const std::vector<ImageId> ids{0, 3, 4, 9, 1000};
  for (const ImageId id : ids) {
    map.push(image(id, id), kFew);
    map.admit(1);
  }
  for (std::uint32_t position = 0; position < ids.size(); ++position) {
    EXPECT_EQ(map.position(ids[position]), position);
    EXPECT_EQ(map.at(position).id, ids[position]);
  }
}

TEST(ImageMap, NewestIsWaitingOrElseTheLastAdmitted) {
  ImageMap map = map_of(waiting(1, 0));
  map.push(image(7, 1), kFew);
  map.push(image(8, 2), kFew);
  EXPECT_EQ(map.newest()->id, 8u);
  map.admit(1);
  EXPECT_EQ(map.newest()->id, 8u);
  map.admit(1);
  EXPECT_EQ(map.newest()->id, 8u);
}

TEST(ImageMap, GivesBackTheFeaturesOfEveryImage) {
  ImageMap map = map_of(waiting(1, 0));
  const std::vector<std::pair<std::size_t, std::size_t>> sizes{{0, 5},     {1, 0}, {80, 3},
                                                               {700, 120}, {2, 2}, {1500, 300}};
  for (ImageId id = 0; id < sizes.size(); ++id) {
    map.push(image(id, id), features(sizes[id].first, sizes[id].second, id));
    map.admit(1);
  }
  Features loaded;
  for (ImageId id = 0; id < sizes.size(); ++id) {
    map.load(*map.find(id), loaded);
    expect_equal(loaded, features(sizes[id].first, sizes[id].second, id));
  }
}

TEST(ImageMap, WordNumbersDisturbNoFeatures) {
  ImageMap map = map_of(waiting(1, 0));
  const Features content = features(1000, 200);
  map.push(image(0, 0), content);
  map.admit(1);
  std::vector<std::uint32_t> points(1000), lines(200);
  std::iota(points.begin(), points.end(), 7u);
  std::iota(lines.begin(), lines.end(), 70'000u);
  map.store_words(*map.find(0), points, lines);
  std::vector<std::uint32_t> points_back(1000), lines_back(200);
  map.load_words(*map.find(0), points_back, lines_back);
  EXPECT_EQ(points_back, points);
  EXPECT_EQ(lines_back, lines);
  Features loaded;
  map.load(*map.find(0), loaded);
  expect_equal(loaded, content);
}

TEST(ImageMap, ARemovedImageLeavesNoHoleAndItsChangeToTheNext) {
  ImageMap map = searchable_map(5);
  map.remove(2);
  EXPECT_EQ(map.searchable(), 4u);
  EXPECT_EQ(map.find(20), nullptr);
  EXPECT_EQ(map.position(30), 2u);
  EXPECT_EQ(map.at(2).change, 3.0 + 4.0);
  EXPECT_EQ(map.at(1).change, 2.0);
  map.remove(3);
  EXPECT_EQ(map.searchable(), 3u);
  EXPECT_EQ(map.at(2).change, 7.0);
}

TEST(ImageMap, RemovingLeavesTheWaitingImagesAlone) {
  ImageMap map = searchable_map(3);
  map.push(image(100, 100), features(50, 1, 9));
  map.push(image(101, 101), kFew);
  map.remove(0);
  ASSERT_NE(map.ready({1000, 0}), nullptr);
  EXPECT_EQ(map.ready({1000, 0})->id, 100u);
  Features loaded;
  map.load(*map.ready({1000, 0}), loaded);
  expect_equal(loaded, features(50, 1, 9));
}

TEST(ImageMap, RoomIsWhatTheImagesLeave) {
  const std::size_t chunks = BlobStore::chunks_for(ImageMap::blob_bytes(1000, 100));
  ImageMap map(waiting(1, 0), 100, 2 * chunks);
  const Features large = features(1000, 100);
  map.push(image(0, 0), large);
  map.admit(1);
  EXPECT_TRUE(map.has_room(large));
  map.push(image(1, 1), large);
  EXPECT_FALSE(map.has_room(large));
  EXPECT_FALSE(map.has_room(kFew));
  map.remove(0);
  EXPECT_TRUE(map.has_room(large));
}

TEST(ImageMap, TheWaitingWindowIsThinnedWhereItIsDensest) {
  ImageMap map = map_of(waiting(1, 0));
  EXPECT_FALSE(map.thin_waiting());
  for (const ImageId id : {0u, 10u, 12u, 13u, 20u, 30u}) map.push(image(id, id), kFew);
  EXPECT_TRUE(map.thin_waiting());  // 12: its neighbours are 3 apart
  EXPECT_TRUE(map.thin_waiting());  // 13 and 10 have 10 and 13 around them: 13
  EXPECT_TRUE(map.thin_waiting());
  EXPECT_TRUE(map.thin_waiting());
  EXPECT_EQ(map.waiting(), 2u);
  EXPECT_FALSE(map.thin_waiting()) << "the oldest and the newest stay";
  EXPECT_EQ(map.ready({1000, 0})->id, 0u);
  EXPECT_EQ(map.newest()->id, 30u);
}

TEST(ImageMap, IsCrowdedOnceTheWaitingHoldMoreThanHalf) {
  ImageMap map(waiting(1, 0), 8, 100);
  for (ImageId id = 0; id < 4; ++id) map.push(image(id, id), kFew);
  EXPECT_FALSE(map.crowded_by_waiting());
  map.push(image(4, 4), kFew);
  EXPECT_TRUE(map.crowded_by_waiting());
  map.admit(1);
  EXPECT_FALSE(map.crowded_by_waiting());
}

TEST(ImageMap, BytesInUseAreThoseOfTheImagesHeld) {
  ImageMap map = map_of(waiting(1, 0));
  map.push(image(0, 0), features(1500, 300));
  const std::size_t one = map.bytes_in_use();
  EXPECT_GE(one, ImageMap::blob_bytes(1500, 300));
  EXPECT_LE(one, ImageMap::blob_bytes(1500, 300) + BlobStore::kChunkBytes + sizeof(MapImage));
  map.admit(1);
  EXPECT_EQ(map.bytes_in_use(), one);
  map.push(image(1, 1), features(1500, 300));
  EXPECT_EQ(map.bytes_in_use(), 2 * one);
  map.remove(0);
  EXPECT_EQ(map.bytes_in_use(), one);
}

}  // namespace
}  // namespace loopd
