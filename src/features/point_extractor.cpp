#include "features/point_extractor.h"

#include <algorithm>
#include <cstring>
#include <opencv2/features2d.hpp>

namespace loopd {
namespace {

constexpr int kPatchPx = 31;  // ORB's patch; also the border in which no point is found
constexpr int kSmallestPx = 2 * kPatchPx + 2;

// Levels that still hold a patch between their borders.
int usable_levels(int smaller_side_px, double scale_factor, int levels) {
  int usable = 0;
  for (double side = smaller_side_px; usable < levels && side >= kSmallestPx; ++usable)
    side /= scale_factor;
  return usable;
}

}  // namespace

class PointExtractor::Impl {
 public:
  explicit Impl(const FeaturesConfig& config) : config_(config) {}

  void extract(const LumaView& image, std::vector<Point>& points,
               std::vector<Descriptor>& descriptors) {
    points.clear();
    descriptors.clear();
    const int levels = usable_levels(std::min(image.width_px, image.height_px),
                                     config_.scale_factor, config_.levels);
    if (config_.points == 0 || levels == 0) return;
    prepare(levels);
    const cv::Mat pixels(image.height_px, image.width_px, CV_8UC1,
                         const_cast<std::uint8_t*>(image.data),
                         static_cast<std::size_t>(image.stride_bytes));
    orb_->detectAndCompute(pixels, cv::noArray(), keypoints_, table_);
    copy_out(points, descriptors);
  }

 private:
  void prepare(int levels) {
    if (orb_ && levels == levels_) return;
    levels_ = levels;
    orb_ = cv::ORB::create(config_.points, static_cast<float>(config_.scale_factor), levels,
                           kPatchPx, 0, 2, cv::ORB::HARRIS_SCORE, kPatchPx, config_.fast_threshold);
  }

  void copy_out(std::vector<Point>& points, std::vector<Descriptor>& descriptors) const {
    points.resize(keypoints_.size());
    descriptors.resize(keypoints_.size());
    for (std::size_t i = 0; i < keypoints_.size(); ++i) {
      const cv::KeyPoint& k = keypoints_[i];
      points[i] = {k.pt.x, k.pt.y, k.size, k.angle};
      std::memcpy(descriptors[i].words.data(), table_.ptr(static_cast<int>(i)),
                  sizeof(descriptors[i].words));
    }
  }

  FeaturesConfig config_;
  int levels_ = 0;
  cv::Ptr<cv::ORB> orb_;
  std::vector<cv::KeyPoint> keypoints_;
  cv::Mat table_;
};

PointExtractor::PointExtractor(const FeaturesConfig& config)
    : impl_(std::make_unique<Impl>(config)) {}
PointExtractor::~PointExtractor() = default;

void PointExtractor::extract(const LumaView& image, std::vector<Point>& points,
                             std::vector<Descriptor>& descriptors) {
  impl_->extract(image, points, descriptors);
}

}  // namespace loopd
