#include "eval/draw_matches.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "support/temp_dir.h"

namespace loopd::eval {
namespace {

using loopd::testing::TempDir;

struct Pixels {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;
  const std::uint8_t* at(int x, int y) const {
    return &rgb[static_cast<std::size_t>(3 * (y * width + x))];
  }
};

Pixels read_png(const std::filesystem::path& path) {
  png_image image;
  std::memset(&image, 0, sizeof image);
  image.version = PNG_IMAGE_VERSION;
  Pixels out;
  if (png_image_begin_read_from_file(&image, path.c_str()) == 0) return out;
  image.format = PNG_FORMAT_RGB;
  out.width = static_cast<int>(image.width);
  out.height = static_cast<int>(image.height);
  out.rgb.resize(PNG_IMAGE_SIZE(image));
  png_image_finish_read(&image, nullptr, out.rgb.data(), 0, nullptr);
  return out;
}

/// A grey image with padding between its rows.
struct Grey {
  Grey(int width, int height, std::uint8_t value)
      : data(static_cast<std::size_t>((width + 5) * height), value),
        view{data.data(), width, height, width + 5} {}
  std::vector<std::uint8_t> data;
  LumaView view;
};

TEST(DrawMatches, PutsBothImagesSideBySideWithTheirPairs) {
  const TempDir dir;
  const Grey query(300, 200, 40);
  const Grey match(260, 240, 80);
  const std::vector<InlierPair> pairs = {{50, 60, 100, 60, false}, {20, 150, 30, 200, true}};
  const Status status = draw_matches(query.view, match.view, pairs, "7 -> 3", dir / "m.png");
  ASSERT_TRUE(status.ok()) << status.error().message;
  const Pixels picture = read_png(dir / "m.png");
  ASSERT_GE(picture.width, 560);
  ASSERT_GE(picture.height, 240);
  const int top = picture.height - 240;
  const int right = picture.width - 260;
  EXPECT_EQ(picture.at(5, top + 100)[0], 40);
  EXPECT_EQ(picture.at(right + 250, top + 5)[0], 80);
  const auto coloured = [&](int x, int y) {
    const std::uint8_t* p = picture.at(x, y);
    return p[0] != p[1] || p[1] != p[2];
  };
  EXPECT_TRUE(coloured(53, top + 60)) << "circle round the query's point";
  EXPECT_TRUE(coloured(200, top + 60)) << "joining line";
  const std::uint8_t* end = picture.at(right + 33, top + 203);
  EXPECT_GT(end[0], end[2]) << "a square of the lines' colour at the match's end point";
  EXPECT_FALSE(coloured(10, top + 20));
}

TEST(DrawMatches, LeavesOutPairsOutsideAndSurvivesAnyCaption) {
  const TempDir dir;
  const Grey image(120, 90, 50);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float inf = std::numeric_limits<float>::infinity();
  const std::vector<InlierPair> pairs = {
      {nan, 5, 5, 5, false}, {5, 5, inf, 5, true}, {-1e30F, 5, 5, 5, false}, {5, 5, 5, 500, true}};
  const std::string caption = std::string(5000, 'x') + "\n\xff\x01";
  ASSERT_TRUE(draw_matches(image.view, image.view, pairs, caption, dir / "m.png").ok());
  const Pixels picture = read_png(dir / "m.png");
  for (int y = picture.height - 90; y < picture.height; ++y) {
    for (int x = 0; x < 120; ++x) ASSERT_EQ(picture.at(x, y)[0], 50) << x << ", " << y;
  }
}

TEST(DrawMatches, ImagesWithoutPixelsAndBadPathsAreErrors) {
  const TempDir dir;
  const Grey image(16, 16, 1);
  EXPECT_FALSE(draw_matches({}, image.view, {}, "", dir / "m.png").ok());
  const Status status = draw_matches(image.view, image.view, {}, "", dir / "none/m.png");
  ASSERT_FALSE(status.ok());
  EXPECT_THAT(status.error().message, ::testing::HasSubstr("none/m.png"));
  EXPECT_TRUE(draw_matches({image.data.data(), 1, 1, 1}, image.view, {}, "", dir / "m.png").ok());
}

}  // namespace
}  // namespace loopd::eval
