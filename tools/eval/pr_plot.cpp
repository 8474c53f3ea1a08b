#include "eval/pr_plot.h"

#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "eval/raster.h"
#include "image/image_write.h"

namespace loopd::eval {
namespace {

constexpr int kWidth = 800;
constexpr int kHeight = 600;
constexpr int kLeft = 80;
constexpr int kRight = 30;
constexpr int kTop = 60;
constexpr int kBottom = 70;

const cv::Scalar kInk(30, 30, 30);
const cv::Scalar kGridInk(222, 222, 222);
const cv::Scalar kCurveInk(31, 90, 180);
const cv::Scalar kFullInk(20, 130, 60);
const cv::Scalar kAcceptedInk(200, 60, 40);

cv::Point place(double recall, double precision) {
  return {
      kLeft + static_cast<int>(std::lround(recall * (kWidth - kLeft - kRight))),
      kHeight - kBottom - static_cast<int>(std::lround(precision * (kHeight - kTop - kBottom)))};
}

void draw_axes(cv::Mat& canvas) {
  for (int i = 0; i <= 10; ++i) {
    const double v = i / 10.0;
    cv::line(canvas, place(v, 0), place(v, 1), kGridInk, 1);
    cv::line(canvas, place(0, v), place(1, v), kGridInk, 1);
    if (i % 2 != 0) continue;
    char label[16];
    std::snprintf(label, sizeof label, "%.1f", v);
    cv::line(canvas, place(v, 0), place(v, 0) + cv::Point(0, 6), kInk, 1);
    cv::line(canvas, place(0, v), place(0, v) - cv::Point(6, 0), kInk, 1);
    draw_text(canvas, label, place(v, 0) + cv::Point(0, 22), 0.5, kInk, TextAlign::kCentre);
    draw_text(canvas, label, place(0, v) + cv::Point(-12, 5), 0.5, kInk, TextAlign::kRight);
  }
  cv::rectangle(canvas, place(0, 0), place(1, 1), kInk, 1);
  draw_text(canvas, "recall", place(0.5, 0) + cv::Point(0, 50), 0.6, kInk, TextAlign::kCentre);
  cv::Mat side(kBottom, kHeight - kTop - kBottom, CV_8UC3, cv::Scalar::all(255));
  draw_text(side, "precision", {side.cols / 2, 24}, 0.6, kInk, TextAlign::kCentre);
  cv::rotate(side, side, cv::ROTATE_90_COUNTERCLOCKWISE);
  side(cv::Rect(0, 0, 30, side.rows)).copyTo(canvas(cv::Rect(4, kTop, 30, side.rows)));
}

void draw_curve(cv::Mat& canvas, const Score& score) {
  for (std::size_t i = 0; i < score.curve.size(); ++i) {
    const Counts& here = score.curve[i].counts;
    const cv::Point at = place(here.recall, here.precision);
    const cv::Point from =
        i == 0 ? place(0, here.precision)
               : place(score.curve[i - 1].counts.recall, score.curve[i - 1].counts.precision);
    cv::line(canvas, from, at, kCurveInk, 2, cv::LINE_AA);
  }
}

std::string percent(double fraction) {
  char text[16];
  std::snprintf(text, sizeof text, "%.2f %%", 100 * fraction);
  return text;
}

void draw_marks(cv::Mat& canvas, const Score& score) {
  cv::Point legend = place(0.03, 0.16);
  if (score.full_precision) {
    const Counts& best = score.full_precision->counts;
    cv::circle(canvas, place(best.recall, best.precision), 6, kFullInk, cv::FILLED, cv::LINE_AA);
    cv::circle(canvas, legend, 6, kFullInk, cv::FILLED, cv::LINE_AA);
    draw_text(canvas, "recall at 100 % precision: " + percent(best.recall),
              legend + cv::Point(14, 5), 0.5, kInk, TextAlign::kLeft);
  }
  legend.y += 28;
  const Counts& accepted = score.accepted;
  cv::drawMarker(canvas, place(accepted.recall, accepted.precision), kAcceptedInk,
                 cv::MARKER_TILTED_CROSS, 14, 2, cv::LINE_AA);
  cv::drawMarker(canvas, legend, kAcceptedInk, cv::MARKER_TILTED_CROSS, 14, 2, cv::LINE_AA);
  draw_text(canvas,
            "accepted loops: precision " + percent(accepted.precision) + ", recall " +
                percent(accepted.recall),
            legend + cv::Point(14, 5), 0.5, kInk, TextAlign::kLeft);
}

}  // namespace

Status write_pr_csv(const Score& score, const std::filesystem::path& path) {
  std::string text = "threshold,precision,recall,right,wrong,dont_care\n";
  for (const CurvePoint& point : score.curve) {
    char line[160];
    std::snprintf(line, sizeof line, "%.17g,%.6f,%.6f,%zu,%zu,%zu\n", point.threshold,
                  point.counts.precision, point.counts.recall, point.counts.right,
                  point.counts.wrong, point.counts.dont_care);
    text += line;
  }
  return image::write_file(path, text.data(), text.size());
}

Status write_pr_png(const Score& score, const std::string& title,
                    const std::filesystem::path& path) {
  cv::Mat canvas(kHeight, kWidth, CV_8UC3, cv::Scalar::all(255));
  draw_axes(canvas);
  draw_curve(canvas, score);
  draw_marks(canvas, score);
  draw_text(canvas, title, {kWidth / 2, 36}, 0.65, kInk, TextAlign::kCentre);
  return image::write_png(path, to_rgb_image(canvas));
}

}  // namespace loopd::eval
