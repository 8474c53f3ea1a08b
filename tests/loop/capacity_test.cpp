#include "loop/capacity.h"

#include <gtest/gtest.h>

#include <limits>

#include "index/inverted_file.h"

namespace loopd {
namespace {

constexpr std::int64_t kMib = std::int64_t{1} << 20;

Config with_budget(std::int64_t bytes) {
  Config config;
  config.memory_budget_bytes = bytes;
  return config;
}

TEST(Capacity, TakesAllOfTheBudgetAndNotMore) {
  for (const std::int64_t mib : {32, 64, 256, 1024}) {
    const Config config = with_budget(mib * kMib);
    const MapLayout layout = map_layout(config);
    EXPECT_LE(layout.bytes, static_cast<std::size_t>(config.memory_budget_bytes));
    EXPECT_GT(layout.bytes, static_cast<std::size_t>(config.memory_budget_bytes) * 97 / 100);
    EXPECT_EQ(map_capacity(config).bytes, layout.bytes);
    EXPECT_EQ(map_capacity(config).full_images, layout.full_images);
  }
}

TEST(Capacity, GrowsWithTheBudgetAndWithFewerFeatures) {
  EXPECT_GT(map_capacity(with_budget(256 * kMib)).full_images,
            3 * map_capacity(with_budget(64 * kMib)).full_images);
  Config poor = with_budget(64 * kMib);
  poor.features.points = 500;
  EXPECT_GT(map_capacity(poor).full_images, 2 * map_capacity(with_budget(64 * kMib)).full_images);
}

TEST(Capacity, ABudgetTooSmallIsAViolation) {
  const auto least = static_cast<std::int64_t>(least_map_bytes(Config{}));
  EXPECT_TRUE(validate(with_budget(least)).empty());
  ASSERT_EQ(validate(with_budget(least - 1)).size(), 1u);
  EXPECT_NE(validate(with_budget(least - 1))[0].find("memory_budget_bytes >= "), std::string::npos);
  for (const std::int64_t bytes : {std::int64_t{0}, std::int64_t{-1}, std::int64_t{1}})
    EXPECT_FALSE(validate(with_budget(bytes)).empty());
}

TEST(Capacity, AnyBudgetIsAnswered) {
  const MapLayout most = map_layout(with_budget(std::numeric_limits<std::int64_t>::max()));
  EXPECT_LE(most.images, Posting::kMaxImages);
  EXPECT_EQ(map_layout(with_budget(0)).images, 0u);
  EXPECT_EQ(map_layout(with_budget(std::numeric_limits<std::int64_t>::min())).bytes, 0u);
}

}  // namespace
}  // namespace loopd
