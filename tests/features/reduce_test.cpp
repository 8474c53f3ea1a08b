#include "features/reduce.h"

#include <gtest/gtest.h>

#include "support/scene_image.h"

namespace loopd {
namespace {

TEST(Reduce, FactorIsTheSmallestThatFits) {
  EXPECT_EQ(reduction_factor(640, 480, 1'000'000), 1);
  EXPECT_EQ(reduction_factor(1920, 1080, 1'000'000), 2);
  EXPECT_EQ(reduction_factor(8000, 6000, 1'000'000), 7);
  EXPECT_EQ(reduction_factor(1, 1, 10'000), 1);
}

TEST(Reduce, AveragesBlocksWithRounding) {
  testing::Image image(5, 3);
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 5; ++x) image.at(x, y) = static_cast<std::uint8_t>(10 * y + x);
  std::vector<std::uint8_t> storage;
  const LumaView half = reduce_image(image.view(), 2, storage);
  ASSERT_EQ(half.width_px, 2);
  ASSERT_EQ(half.height_px, 1);
  EXPECT_EQ(half.data[0], 6);  // (0 + 1 + 10 + 11 + 2) / 4
  EXPECT_EQ(half.data[1], 8);
}

TEST(Reduce, FactorOneIsTheImageItself) {
  const testing::Image image(4, 4, 7);
  std::vector<std::uint8_t> storage;
  EXPECT_EQ(reduce_image(image.view(), 1, storage).data, image.pixels.data());
}

}  // namespace
}  // namespace loopd
