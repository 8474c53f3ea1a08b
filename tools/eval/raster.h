#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "image/image_write.h"

namespace loopd::eval {

enum class TextAlign : std::uint8_t { kLeft, kCentre, kRight };

/// Writes `text` on one line with its baseline at `at`, cut with "..." where it would pass the
/// picture's width; bytes other than printable ASCII appear as '?'. Colours are R, G, B.
void draw_text(cv::Mat& canvas, const std::string& text, cv::Point at, double scale,
               const cv::Scalar& colour, TextAlign align);

/// Copies a CV_8UC3 matrix in R, G, B order.
image::RgbImage to_rgb_image(const cv::Mat& canvas);

}  // namespace loopd::eval
