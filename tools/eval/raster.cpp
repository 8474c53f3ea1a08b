#include "eval/raster.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace loopd::eval {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;

int width_of(const std::string& text, double scale) {
  return cv::getTextSize(text, kFont, scale, 1, nullptr).width;
}

}  // namespace

void draw_text(cv::Mat& canvas, const std::string& text, cv::Point at, double scale,
               const cv::Scalar& colour, TextAlign align) {
  constexpr std::size_t kMaxLetters = 400;
  std::string shown = text.substr(0, kMaxLetters);
  std::replace_if(
      shown.begin(), shown.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  const int room = align == TextAlign::kLeft ? canvas.cols - at.x : canvas.cols;
  if (width_of(shown, scale) > room) {
    while (!shown.empty() && width_of(shown + "...", scale) > room) shown.pop_back();
    shown += "...";
  }
  if (align == TextAlign::kCentre) at.x -= width_of(shown, scale) / 2;
  if (align == TextAlign::kRight) at.x -= width_of(shown, scale);
  cv::putText(canvas, shown, at, kFont, scale, colour, 1, cv::LINE_AA);
}

image::RgbImage to_rgb_image(const cv::Mat& canvas) {
  image::RgbImage out{canvas.cols, canvas.rows, {}};
  out.data.reserve(canvas.total() * 3);
  for (int y = 0; y < canvas.rows; ++y) {
    const std::uint8_t* row = canvas.ptr<std::uint8_t>(y);
    out.data.insert(out.data.end(), row, row + static_cast<std::ptrdiff_t>(canvas.cols) * 3);
  }
  return out;
}

}  // namespace loopd::eval
