#include "features/line_extractor.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <tuple>

#include "features/lbd.h"

namespace loopd {
namespace {

constexpr int kSmallestPx = 16;  // of an image's side; LSD has nothing to say about less

float squared_length(const Line& line) {
  const float dx = line.end_x_px - line.start_x_px;
  const float dy = line.end_y_px - line.start_y_px;
  return dx * dx + dy * dy;
}

// Longest first; a total order, so that the result never depends on the sort.
bool longer(const Line& a, const Line& b) {
  const auto key = [](const Line& l) {
    return std::make_tuple(-squared_length(l), l.start_y_px, l.start_x_px, l.end_y_px, l.end_x_px);
  };
  return key(a) < key(b);
}

}  // namespace

class LineExtractor::Impl {
 public:
  explicit Impl(const FeaturesConfig& config)
      : config_(config),
        detector_(cv::createLineSegmentDetector(cv::LSD_REFINE_STD, config.line_scale)) {}

  void extract(const LumaView& image, std::vector<Line>& lines,
               std::vector<Descriptor>& descriptors) {
    lines.clear();
    descriptors.clear();
    if (config_.lines == 0 || std::min(image.width_px, image.height_px) < kSmallestPx) return;
    detect(image, lines);
    gradient_.compute(image);
    direct_by_contrast(gradient_, lines);
    descriptors.resize(lines.size());
    describe_lines(gradient_, lines, descriptors);
  }

 private:
  void detect(const LumaView& image, std::vector<Line>& lines) {
    const cv::Mat pixels(image.height_px, image.width_px, CV_8UC1,
                         const_cast<std::uint8_t*>(image.data),
                         static_cast<std::size_t>(image.stride_bytes));
    detector_->detect(pixels, segments_);
    const auto min_length =
        static_cast<float>(config_.min_line_length * std::min(image.width_px, image.height_px));
    for (const cv::Vec4f& s : segments_) {
      const Line line{s[0], s[1], s[2], s[3]};
      if (squared_length(line) >= min_length * min_length) lines.push_back(line);
    }
    std::sort(lines.begin(), lines.end(), longer);
    const auto keep = static_cast<std::size_t>(config_.lines);
    if (lines.size() > keep) lines.resize(keep);
  }

  FeaturesConfig config_;
  cv::Ptr<cv::LineSegmentDetector> detector_;
  std::vector<cv::Vec4f> segments_;
  GradientImage gradient_;
};

LineExtractor::LineExtractor(const FeaturesConfig& config)
    : impl_(std::make_unique<Impl>(config)) {}
LineExtractor::~LineExtractor() = default;

void LineExtractor::extract(const LumaView& image, std::vector<Line>& lines,
                            std::vector<Descriptor>& descriptors) {
  impl_->extract(image, lines, descriptors);
}

}  // namespace loopd
