#include "verify/sampling.h"

#include <algorithm>

namespace loopd {
namespace {

constexpr std::size_t kSmallestPool = 16;
constexpr int kMaxRedraws = 64;

// Of two weights: a line end point is a quarter as likely as a point, because it slides along its
// line and is often cut off by the image's edge.
constexpr std::size_t kPointWeight = 4;

std::size_t pool(std::size_t count, int iteration) {
  const std::size_t share = count >> (3 - iteration % 4);
  return std::min(count, std::max(share, kSmallestPool));
}

}  // namespace

bool Sampler::draw(int iteration, Random& random, std::span<std::uint32_t> sample) const {
  const Correspondences& c = correspondences_;
  if (c.size() < sample.size()) return false;
  const std::size_t points = pool(c.points, iteration), ends = pool(2 * c.lines, iteration);
  const std::size_t weight = kPointWeight * points + ends;
  std::size_t filled = 0;
  for (int redraws = 0; filled < sample.size() && redraws < kMaxRedraws; ++redraws) {
    const bool from_points = random.below(weight) < kPointWeight * points;
    const std::uint32_t entry =
        from_points ? c.trusted_points[random.below(points)] : c.trusted_ends[random.below(ends)];
    const auto drawn = sample.first(filled);
    if (std::find(drawn.begin(), drawn.end(), entry) == drawn.end()) sample[filled++] = entry;
  }
  return filled == sample.size();
}

double Sampler::inlier_share(std::size_t points, std::size_t ends) const {
  const Correspondences& c = correspondences_;
  const std::size_t weight = kPointWeight * c.points + 2 * c.lines;
  return weight == 0
             ? 0.0
             : static_cast<double>(kPointWeight * points + ends) / static_cast<double>(weight);
}

}  // namespace loopd
