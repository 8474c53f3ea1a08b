#include "eval/draw_matches.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "eval/raster.h"
#include "image/image_write.h"

namespace loopd::eval {
namespace {

constexpr int kBanner = 52;
constexpr int kGap = 6;
constexpr int kMaxSide = 8192;  // of one image, so that the picture stays within PNG's usual limits

const cv::Scalar kPointInk(60, 220, 90);
const cv::Scalar kLineInk(255, 120, 30);
const cv::Scalar kTextInk(240, 240, 240);

bool drawable(const LumaView& view) {
  return view.data != nullptr && view.width_px >= 1 && view.height_px >= 1 &&
         view.width_px <= kMaxSide && view.height_px <= kMaxSide &&
         view.stride_bytes >= view.width_px;
}

void paste(const LumaView& view, cv::Mat& canvas, cv::Point at) {
  for (int y = 0; y < view.height_px; ++y) {
    const std::uint8_t* row = view.data + static_cast<std::ptrdiff_t>(y) * view.stride_bytes;
    std::uint8_t* out = canvas.ptr<std::uint8_t>(at.y + y) + static_cast<std::ptrdiff_t>(at.x) * 3;
    for (int x = 0; x < view.width_px; ++x) std::fill_n(out + 3 * x, 3, row[x]);
  }
}

bool inside(float x, float y, const LumaView& view) {  // false for NaN
  return x >= -0.5F && y >= -0.5F && x <= static_cast<float>(view.width_px) - 0.5F &&
         y <= static_cast<float>(view.height_px) - 0.5F;
}

cv::Point rounded(float x, float y) {
  return {static_cast<int>(std::lround(x)), static_cast<int>(std::lround(y))};
}

void draw_mark(cv::Mat& canvas, cv::Point at, bool is_line) {
  if (is_line) {
    cv::rectangle(canvas, at - cv::Point(3, 3), at + cv::Point(3, 3), kLineInk, 1);
  } else {
    cv::circle(canvas, at, 3, kPointInk, 1, cv::LINE_AA);
  }
}

void draw_key(cv::Mat& canvas, std::size_t points, std::size_t line_ends) {
  draw_mark(canvas, {14, 38}, false);
  const std::string point_text = std::to_string(points) + " points";
  draw_text(canvas, point_text, {24, 43}, 0.45, kPointInk, TextAlign::kLeft);
  draw_mark(canvas, {144, 38}, true);
  const std::string line_text = std::to_string(line_ends) + " line end points";
  draw_text(canvas, line_text, {154, 43}, 0.45, kLineInk, TextAlign::kLeft);
}

}  // namespace

Status draw_matches(const LumaView& query, const LumaView& match, std::span<const InlierPair> pairs,
                    const std::string& caption, const std::filesystem::path& path) {
  if (!drawable(query) || !drawable(match)) {
    return Error{"cannot draw " + path.string() + ": an image is empty or larger than " +
                     std::to_string(kMaxSide) + " pixels a side",
                 0};
  }
  const int width = query.width_px + kGap + match.width_px;
  const int height = kBanner + std::max(query.height_px, match.height_px);
  cv::Mat canvas(height, width, CV_8UC3, cv::Scalar::all(25));
  const cv::Point query_at(0, kBanner);
  const cv::Point match_at(query.width_px + kGap, kBanner);
  paste(query, canvas, query_at);
  paste(match, canvas, match_at);
  std::size_t shown[2] = {0, 0};
  for (const InlierPair& pair : pairs) {
    if (!inside(pair.query_x_px, pair.query_y_px, query)) continue;
    if (!inside(pair.match_x_px, pair.match_y_px, match)) continue;
    const cv::Point from = query_at + rounded(pair.query_x_px, pair.query_y_px);
    const cv::Point to = match_at + rounded(pair.match_x_px, pair.match_y_px);
    cv::line(canvas, from, to, pair.is_line ? kLineInk : kPointInk, 1, cv::LINE_AA);
    draw_mark(canvas, from, pair.is_line);
    draw_mark(canvas, to, pair.is_line);
    ++shown[pair.is_line ? 1 : 0];
  }
  draw_text(canvas, caption, {8, 20}, 0.5, kTextInk, TextAlign::kLeft);
  draw_key(canvas, shown[0], shown[1]);
  return image::write_png(path, to_rgb_image(canvas));
}

}  // namespace loopd::eval
