#include "loop/fusion.h"

#include <algorithm>
#include <cmath>

namespace loopd {
namespace {

bool better(const Candidate& a, const Candidate& b) {
  return a.score != b.score ? a.score > b.score : a.image < b.image;
}

// Eq. 2, divided by the length: ((c - i) / c) s~.
double borda(std::size_t length, std::size_t rank, double score) {
  return static_cast<double>(length - rank) / static_cast<double>(length) * score;
}

std::size_t rank_of(const std::vector<Candidate>& list, std::size_t length, ImageId image) {
  for (std::size_t i = 0; i < length; ++i)
    if (list[i].image == image) return i;
  return length;
}

}  // namespace

void normalise_scores(std::vector<Candidate>& candidates, double min_similarity,
                      std::size_t max_candidates) {
  if (candidates.empty()) return;
  const double highest = candidates.front().score;
  const double lowest = candidates.back().score;
  const double range = highest - lowest;
  for (Candidate& c : candidates)
    c.score = range > 0 ? (c.score - lowest) / range : 1.0;  // Equation (1)
  const auto end = std::find_if(candidates.begin(), candidates.end(),
                                [&](const Candidate& c) { return c.score < min_similarity; });
  candidates.erase(end, candidates.end());
  if (candidates.size() > max_candidates) candidates.resize(max_candidates);
}

void fuse(const std::vector<Candidate>& points, const std::vector<Candidate>& lines,
          double one_list_penalty, std::vector<Candidate>& fused) {
  fused.clear();
  const std::size_t c = std::min(points.size(), lines.size());
  const double penalty = c == 0 ? 1.0 : one_list_penalty;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::size_t j = i < c ? rank_of(lines, c, points[i].image) : c;
    if (j < c) {
      const double product = borda(c, i, points[i].score) * borda(c, j, lines[j].score);
      fused.push_back({points[i].image, std::sqrt(product)});  // Equation (3)
    } else {
      fused.push_back({points[i].image, penalty * borda(points.size(), i, points[i].score)});
    }
  }
  for (std::size_t j = 0; j < lines.size(); ++j) {
    const bool merged = j < c && rank_of(points, c, lines[j].image) < c;
    const bool in_points = rank_of(points, points.size(), lines[j].image) < points.size();
    const double vote = penalty * borda(lines.size(), j, lines[j].score);
    if (!in_points) {
      fused.push_back({lines[j].image, vote});
    } else if (!merged) {  // in both lists, but not in both tops: the better of its two votes
      auto same = std::find_if(fused.begin(), fused.end(),
                               [&](const Candidate& f) { return f.image == lines[j].image; });
      same->score = std::max(same->score, vote);
    }
  }
  std::sort(fused.begin(), fused.end(), better);
}

}  // namespace loopd
