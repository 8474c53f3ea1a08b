#include "features/line_extractor.h"

#include <algorithm>
#include <tuple>

#include "features/gradient_image.h"
#include "features/lbd.h"
#include "features/segment_detector.h"

namespace loopd {
namespace {

constexpr int kSmallestPx = 12;  // of a shrunk image's side; there is nothing to say about less

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
  explicit Impl(const FeaturesConfig& config) : config_(config) {}

  void extract(const LumaView& shrunk, int width_px, int height_px, std::vector<Line>& lines,
               std::vector<Descriptor>& descriptors) {
    lines.clear();
    descriptors.clear();
    if (config_.lines == 0 || std::min(shrunk.width_px, shrunk.height_px) < kSmallestPx ||
        std::max(shrunk.width_px, shrunk.height_px) > SegmentDetector::kLargestPx)
      return;
    gradient_.compute(shrunk);
    const double min_length = config_.min_line_length * std::min(shrunk.width_px, shrunk.height_px);
    detector_.detect(gradient_, static_cast<float>(min_length), lines);
    keep_longest(lines);
    descriptors.resize(lines.size());
    describe_lines(gradient_, lines, descriptors);
    enlarge(shrunk, width_px, height_px, lines);
  }

 private:
  void keep_longest(std::vector<Line>& lines) const {
    const auto keep = static_cast<std::size_t>(config_.lines);
    if (lines.size() > keep) {
      std::nth_element(lines.begin(), lines.begin() + config_.lines, lines.end(), longer);
      lines.resize(keep);
    }
    std::sort(lines.begin(), lines.end(), longer);
  }

  // Centres of pixels of the shrunk image, in pixels of the full one.
  static void enlarge(const LumaView& shrunk, int width_px, int height_px,
                      std::vector<Line>& lines) {
    const float x = static_cast<float>(width_px) / static_cast<float>(shrunk.width_px);
    const float y = static_cast<float>(height_px) / static_cast<float>(shrunk.height_px);
    for (Line& line : lines)
      line = {(line.start_x_px + 0.5F) * x - 0.5F, (line.start_y_px + 0.5F) * y - 0.5F,
              (line.end_x_px + 0.5F) * x - 0.5F, (line.end_y_px + 0.5F) * y - 0.5F};
  }

  FeaturesConfig config_;
  GradientImage gradient_;
  SegmentDetector detector_;
};

LineExtractor::LineExtractor(const FeaturesConfig& config)
    : impl_(std::make_unique<Impl>(config)) {}
LineExtractor::~LineExtractor() = default;

void LineExtractor::extract(const LumaView& shrunk, int width_px, int height_px,
                            std::vector<Line>& lines, std::vector<Descriptor>& descriptors) {
  impl_->extract(shrunk, width_px, height_px, lines, descriptors);
}

}  // namespace loopd
