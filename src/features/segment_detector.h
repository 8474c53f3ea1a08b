#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "features/gradient_image.h"
#include "loopd/features.h"

namespace loopd {

/// Finds straight edges with sub-pixel accuracy: a relative of LSD (Grompone et al. 2010) and of
/// Edge Drawing (Topal and Akinlar 2012). As in LSD, regions of pixels whose gradient agrees within
/// 22.5 degrees grow from the strongest pixel on, and each is approximated by a line; as in Edge
/// Drawing, only the crest of an edge takes part (pixels whose gradient is largest across the
/// edge), a fifth of LSD's pixels. What is straight within `kStraightPx` stays one line, what bends
/// is parted where it bends.
/// Thread: one caller at a time; keeps its scratch memory between images.
class SegmentDetector {
 public:
  static constexpr int kLargestPx = 16'000;  ///< of an image's side

  struct Position {
    float x = 0;
    float y = 0;
  };

  /// Replaces `lines` by the segments of at least `min_length_px`, in pixels of `gradient`,
  /// directed by contrast (walking from start to end on the screen, the darker side is on the
  /// right), in no order that matters but the same every time. Cost: bounded by the pixels; about 1
  /// ms for 533x400.
  void detect(const GradientImage& gradient, float min_length_px, std::vector<Line>& lines);

 private:
  struct Pixel {
    std::int16_t x = 0;
    std::int16_t y = 0;
  };
  struct Sum {
    std::int32_t x = 0;
    std::int32_t y = 0;
  };

  void find_crests(const GradientImage& gradient);
  void collect_row(std::size_t y, std::size_t width, const std::int16_t* strength);
  void sort_by_strength();
  bool grow(const GradientImage& gradient, std::uint32_t seed, float min_length_px);
  void walk(const GradientImage& gradient, Pixel from, int way, Sum& sum, std::vector<Pixel>& out);
  bool step(const GradientImage& gradient, int way, Sum& sum, Pixel& at);
  bool step_over_gap(const GradientImage& gradient, Sum direction, Sum& sum, Pixel& at);
  bool take(const GradientImage& gradient, int x, int y, Sum& sum, Pixel& at);
  void refine(const GradientImage& gradient);
  void part(std::size_t first, std::size_t last, float min_length_px, std::vector<Line>& lines);

  std::vector<std::uint8_t> crest_;       // 1 = on a crest and in no region yet
  std::vector<std::int16_t> strength_;    // three rows of gradient magnitudes
  std::vector<std::uint8_t> horizontal_;  // three rows: the gradient is rather horizontal
  std::vector<std::uint32_t> found_;      // crest pixels (y * width + x) in reading order
  std::vector<std::uint16_t> found_bucket_;
  std::vector<std::uint32_t> seeds_;  // the same, strongest first
  std::vector<std::uint32_t> bucket_end_;
  std::vector<Pixel> ahead_;
  std::vector<Pixel> chain_;  // one region, from start to end
  std::vector<Position> refined_;
  int width_ = 0;
  int height_ = 0;
};

}  // namespace loopd
