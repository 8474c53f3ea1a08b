#include "features/segment_detector.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdlib>
#include <cstring>

namespace loopd {
namespace {

using Gradient = GradientImage::Gradient;

// LSD's threshold is 5.2 grey levels a pixel, where quantisation alone turns the direction by 22.5
// degrees; the wider kernel averages 16 times the pixels' noise.
constexpr int kMinStrength = 4 * GradientImage::kUnit;
constexpr float kCosSquaredTolerance = 0.853553391F;  // of 22.5 degrees
constexpr float kStraightPx = 1.2F;                   // a crest pixel beside its line
constexpr int kMaxGapPx = 3;                          // along a line, without a crest
constexpr int kBucketShift = 4;
constexpr std::size_t kBuckets = (2 * GradientImage::kLargest >> kBucketShift) + 1;

constexpr int kStepX[] = {1, 1, 0, -1, -1, -1, 0, 1};
constexpr int kStepY[] = {0, 1, 1, 1, 0, -1, -1, -1};

// The gradient's length within 3 %: max + 3/8 min.
inline int strength_of(int x, int y) {
  const int a = std::abs(x);
  const int b = std::abs(y);
  const int low = std::min(a, b);
  return std::max(a, b) + (low >> 2) + (low >> 3);
}

void strengths_of_row(const Gradient* __restrict row, std::size_t width,
                      std::int16_t* __restrict strength, std::uint8_t* __restrict horizontal) {
  for (std::size_t x = 0; x < width; ++x) {
    const auto gx = row[x].x;
    const auto gy = row[x].y;
    const auto a = static_cast<std::int16_t>(gx < 0 ? -gx : gx);
    const auto b = static_cast<std::int16_t>(gy < 0 ? -gy : gy);
    const auto low = a < b ? a : b;
    const auto high = a < b ? b : a;
    strength[x] = static_cast<std::int16_t>(high + (low >> 2) + (low >> 3));
    horizontal[x] = a >= b ? 0xff : 0;
  }
}

// A pixel is on a crest if no neighbour across the edge (left and right, or above and below,
// whichever the gradient is closer to) is stronger; of two equals the second is.
void crests_of_row(const std::int16_t* __restrict above, const std::int16_t* __restrict here,
                   const std::int16_t* __restrict below, const std::uint8_t* __restrict horizontal,
                   std::size_t width, std::uint8_t* __restrict crest) {
  for (std::size_t x = 1; x + 1 < width; ++x) {
    const std::int16_t m = here[x];
    const bool beside = (m > here[x - 1]) & (m >= here[x + 1]);
    const bool upright = (m > above[x]) & (m >= below[x]);
    const bool strong = m >= kMinStrength;
    const auto h = horizontal[x];
    crest[x] = static_cast<std::uint8_t>(strong & ((beside & h) | (upright & ~h)));
  }
}

// The eighth of the circle (0 = right, clockwise on the screen) that a direction is closest to.
int octant_of(std::int32_t x, std::int32_t y) {
  const std::int64_t a = std::abs(x);
  const std::int64_t b = std::abs(y);
  if (29 * b < 12 * a) return x > 0 ? 0 : 4;
  if (29 * a < 12 * b) return y > 0 ? 2 : 6;
  return y > 0 ? (x > 0 ? 1 : 3) : (x > 0 ? 7 : 5);
}

// How far the parabola through three strengths peaks beside the middle one, in pixels.
float peak_offset(int before, int middle, int after) {
  const int curvature = 2 * middle - before - after;
  if (curvature <= 0) return 0;
  return 0.5F * static_cast<float>(after - before) / static_cast<float>(curvature);
}

using Position = SegmentDetector::Position;

bool is_longer(Position a, Position b, float length_px) {
  const float dx = b.x - a.x;
  const float dy = b.y - a.y;
  return length_px <= 0 || dx * dx + dy * dy >= length_px * length_px;
}

struct Fit {
  float x = 0;  // the positions' centre
  float y = 0;
  float dx = 0;  // unit vector from the first towards the last
  float dy = 0;
};

// Total least squares: the line through the centre along the larger eigenvector of the scatter.
Fit fit_line(std::span<const Position> positions) {
  const Position origin = positions.front();
  double sx = 0;
  double sy = 0;
  double sxx = 0;
  double sxy = 0;
  double syy = 0;
  for (const Position& p : positions) {
    const double x = p.x - origin.x;
    const double y = p.y - origin.y;
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
    syy += y * y;
  }
  const auto n = static_cast<double>(positions.size());
  const double xx = sxx - sx * sx / n;
  const double xy = sxy - sx * sy / n;
  const double yy = syy - sy * sy / n;
  const double spread = std::sqrt((xx - yy) * (xx - yy) + 4 * xy * xy);
  double ux = xx >= yy ? xx - yy + spread : 2 * xy;
  double uy = xx >= yy ? 2 * xy : yy - xx + spread;
  const double forward =
      ux * (positions.back().x - origin.x) + uy * (positions.back().y - origin.y);
  const double norm = std::sqrt(ux * ux + uy * uy);
  const double scale = norm > 0 ? (forward < 0 ? -1 : 1) / norm : 0;
  return {origin.x + static_cast<float>(sx / n), origin.y + static_cast<float>(sy / n),
          static_cast<float>(ux * scale), static_cast<float>(uy * scale)};
}

bool is_straight(std::span<const Position> positions, const Fit& fit) {
  float worst = 0;
  for (const Position& p : positions)
    worst = std::max(worst, std::abs((p.x - fit.x) * fit.dy - (p.y - fit.y) * fit.dx));
  return worst <= kStraightPx;
}

Line between(const Fit& fit, Position a, Position b) {
  const float from = (a.x - fit.x) * fit.dx + (a.y - fit.y) * fit.dy;
  const float to = (b.x - fit.x) * fit.dx + (b.y - fit.y) * fit.dy;
  return {fit.x + from * fit.dx, fit.y + from * fit.dy, fit.x + to * fit.dx, fit.y + to * fit.dy};
}

// The position farthest from the chord; never in the last 64th at either end, so that hostile
// images cannot have single positions cut off one by one.
std::size_t corner_of(std::span<const Position> positions) {
  const Position a = positions.front();
  const float cx = positions.back().x - a.x;
  const float cy = positions.back().y - a.y;
  const std::size_t margin = 1 + positions.size() / 64;
  std::size_t corner = margin;
  float farthest = -1;
  for (std::size_t i = margin; i + margin < positions.size(); ++i) {
    const float distance = std::abs((positions[i].x - a.x) * cy - (positions[i].y - a.y) * cx);
    if (distance > farthest) {
      farthest = distance;
      corner = i;
    }
  }
  return corner;
}

}  // namespace

void SegmentDetector::detect(const GradientImage& gradient, float min_length_px,
                             std::vector<Line>& lines) {
  lines.clear();
  width_ = gradient.width_px;
  height_ = gradient.height_px;
  assert(width_ <= kLargestPx && height_ <= kLargestPx);
  find_crests(gradient);
  sort_by_strength();
  for (const std::uint32_t seed : seeds_) {
    if (crest_[seed] == 0 || !grow(gradient, seed, min_length_px)) continue;
    refine(gradient);
    part(0, chain_.size() - 1, min_length_px, lines);
  }
}

void SegmentDetector::find_crests(const GradientImage& gradient) {
  const auto width = static_cast<std::size_t>(width_);
  const auto height = static_cast<std::size_t>(height_);
  crest_.resize(width * height);
  std::memset(crest_.data(), 0, crest_.size());
  found_.clear();
  found_bucket_.clear();
  if (width < 3 || height < 3) return;
  strength_.resize(3 * width);
  horizontal_.resize(3 * width);
  const auto fill = [&](std::size_t y) {
    strengths_of_row(gradient.row(static_cast<int>(y)), width, &strength_[y % 3 * width],
                     &horizontal_[y % 3 * width]);
  };
  fill(0);
  fill(1);
  for (std::size_t y = 1; y + 1 < height; ++y) {
    fill(y + 1);
    const std::int16_t* here = &strength_[y % 3 * width];
    crests_of_row(&strength_[(y - 1) % 3 * width], here, &strength_[(y + 1) % 3 * width],
                  &horizontal_[y % 3 * width], width, &crest_[y * width]);
    collect_row(y, width, here);
  }
}

void SegmentDetector::collect_row(std::size_t y, std::size_t width, const std::int16_t* strength) {
  const std::uint8_t* row = crest_.data() + y * width;
  const auto collect = [&](std::size_t x) {
    if (row[x] == 0) return;
    found_.push_back(static_cast<std::uint32_t>(y * width + x));
    found_bucket_.push_back(static_cast<std::uint16_t>(strength[x] >> kBucketShift));
  };
  std::size_t x = 0;
  for (; x + 8 <= width; x += 8) {  // most groups of eight are empty
    std::uint64_t eight = 0;
    std::memcpy(&eight, row + x, 8);
    if (eight != 0)
      for (std::size_t i = 0; i < 8; ++i) collect(x + i);
  }
  for (; x < width; ++x) collect(x);
}

// Counting sort, strongest first; equals stay in reading order.
void SegmentDetector::sort_by_strength() {
  bucket_end_.assign(kBuckets + 1, 0);
  for (const std::uint16_t bucket : found_bucket_) ++bucket_end_[kBuckets - 1 - bucket + 1];
  for (std::size_t i = 1; i < bucket_end_.size(); ++i) bucket_end_[i] += bucket_end_[i - 1];
  seeds_.resize(found_.size());
  for (std::size_t i = 0; i < found_.size(); ++i)
    seeds_[bucket_end_[kBuckets - 1 - found_bucket_[i]]++] = found_[i];
}

// Fills `chain_` with the region of a seed, from start to end; false if it is too short to matter.
bool SegmentDetector::grow(const GradientImage& gradient, std::uint32_t seed, float min_length_px) {
  const Pixel start{static_cast<std::int16_t>(seed % static_cast<std::uint32_t>(width_)),
                    static_cast<std::int16_t>(seed / static_cast<std::uint32_t>(width_))};
  const Gradient& g = gradient.at(start.x, start.y);
  Sum sum{g.x, g.y};
  crest_[seed] = 0;
  ahead_.clear();
  walk(gradient, start, -1, sum, ahead_);
  chain_.assign(ahead_.rbegin(), ahead_.rend());
  chain_.push_back(start);
  walk(gradient, start, 1, sum, chain_);
  const auto position = [](Pixel p) {
    return Position{static_cast<float>(p.x), static_cast<float>(p.y)};
  };
  // Sub-pixel positions can be half a pixel farther out at either end.
  return chain_.size() >= 3 &&
         is_longer(position(chain_.front()), position(chain_.back()), min_length_px - 2);
}

void SegmentDetector::walk(const GradientImage& gradient, Pixel from, int way, Sum& sum,
                           std::vector<Pixel>& out) {
  while (step(gradient, way, sum, from)) out.push_back(from);
}

// One step along the region's direction, which is that of the gradient's sum turned by 90 degrees:
// to the neighbour ahead or those beside it, else over a gap.
bool SegmentDetector::step(const GradientImage& gradient, int way, Sum& sum, Pixel& at) {
  const Sum direction{-way * sum.y, way * sum.x};
  const int ahead = octant_of(direction.x, direction.y);
  // The side that the exact direction leans to comes before the other.
  const std::int64_t lean =
      std::int64_t{kStepX[ahead]} * direction.y - std::int64_t{kStepY[ahead]} * direction.x;
  const int side = lean >= 0 ? 1 : 7;
  const Pixel from = at;
  for (const int octant : {ahead, (ahead + side) & 7, (ahead - side) & 7})
    if (take(gradient, from.x + kStepX[octant], from.y + kStepY[octant], sum, at)) return true;
  return step_over_gap(gradient, direction, sum, at);
}

bool SegmentDetector::step_over_gap(const GradientImage& gradient, Sum direction, Sum& sum,
                                    Pixel& at) {
  const Pixel from = at;
  const bool flat = std::abs(direction.x) >= std::abs(direction.y);
  const std::int32_t main = flat ? direction.x : direction.y;
  const std::int32_t other = flat ? direction.y : direction.x;
  const float slope =
      static_cast<float>(other) / static_cast<float>(std::max(1, std::abs(main)));  // within 1
  const int forward = main >= 0 ? 1 : -1;
  for (int far = 2; far <= kMaxGapPx; ++far) {
    // Rounded; the added whole number keeps the conversion from rounding negatives up.
    const int across =
        static_cast<int>(slope * static_cast<float>(far) + (kMaxGapPx + 0.5F)) - kMaxGapPx;
    for (const int beside : {0, 1, -1}) {
      const int x = flat ? from.x + far * forward : from.x + across + beside;
      const int y = flat ? from.y + across + beside : from.y + far * forward;
      if (take(gradient, x, y, sum, at)) return true;
    }
  }
  return false;
}

// Takes a crest pixel into the region if its gradient agrees with the region's.
bool SegmentDetector::take(const GradientImage& gradient, int x, int y, Sum& sum, Pixel& at) {
  if (x < 0 || y < 0 || x >= width_ || y >= height_) return false;
  std::uint8_t& crest = crest_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                               static_cast<std::size_t>(x)];
  if (crest == 0) return false;
  const Gradient& g = gradient.at(x, y);
  const auto gx = static_cast<float>(g.x);
  const auto gy = static_cast<float>(g.y);
  const auto sx = static_cast<float>(sum.x);
  const auto sy = static_cast<float>(sum.y);
  const float dot = gx * sx + gy * sy;
  if (dot <= 0 || dot * dot < kCosSquaredTolerance * (gx * gx + gy * gy) * (sx * sx + sy * sy))
    return false;
  crest = 0;
  sum.x += g.x;
  sum.y += g.y;
  at = {static_cast<std::int16_t>(x), static_cast<std::int16_t>(y)};
  return true;
}

// Where between the pixels the crest is, across the edge.
void SegmentDetector::refine(const GradientImage& gradient) {
  refined_.resize(chain_.size());
  for (std::size_t i = 0; i < chain_.size(); ++i) {
    const Pixel p = chain_[i];
    const Gradient* g = &gradient.at(p.x, p.y);
    const bool flat = std::abs(g->x) >= std::abs(g->y);
    const std::ptrdiff_t across = flat ? 1 : width_;
    const float offset =
        peak_offset(strength_of(g[-across].x, g[-across].y), strength_of(g->x, g->y),
                    strength_of(g[across].x, g[across].y));
    refined_[i] = {static_cast<float>(p.x) + (flat ? offset : 0),
                   static_cast<float>(p.y) + (flat ? 0 : offset)};
  }
}

// Lines through the straight parts of the positions first..last: what is not straight is parted at
// the position farthest from its chord. The shorter part goes first, so that calls nest at most
// log2(n) deep.
void SegmentDetector::part(std::size_t first, std::size_t last, float min_length_px,
                           std::vector<Line>& lines) {
  while (last >= first + 2 && is_longer(refined_[first], refined_[last], min_length_px - 1)) {
    const std::span<const Position> positions{refined_.data() + first, last - first + 1};
    const Fit fit = fit_line(positions);
    if (is_straight(positions, fit)) {
      const Line line = between(fit, positions.front(), positions.back());
      if (is_longer({line.start_x_px, line.start_y_px}, {line.end_x_px, line.end_y_px},
                    min_length_px))
        lines.push_back(line);
      return;
    }
    const std::size_t corner = first + corner_of(positions);
    if (corner - first < last - corner) {
      part(first, corner, min_length_px, lines);
      first = corner;
    } else {
      part(corner, last, min_length_px, lines);
      last = corner;
    }
  }
}

}  // namespace loopd
