#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "verify/correspondences.h"
#include "verify/sampling.h"

namespace loopd {

// Robust estimation of a two-view model from points and line end points together (RANSAC with
// local optimisation and a truncated quadratic cost). An `Estimator` has
//   using Model; static constexpr std::size_t kSampleSize, kMaxModels;
//   std::size_t solve(c, sample, std::span<Model, kMaxModels>)   models of a minimal sample
//   void residuals(model, c, first, last, out)   squared error / squared tolerance; <= 1 is inlier
//   bool refine(c, weights, model)               weighted least squares, starting at `model`

/// A model with its support. Cost of a feature is min(residual, 1), of a line that of its better
/// end; score = features - total cost.
template <class Model>
struct Scored {
  Model model{};
  double score = 0;
};

/// Counted support of a model: a line is an inlier if at least one of its end points is.
struct Support {
  std::size_t points = 0;
  std::size_t lines = 0;
  std::size_t ends = 0;  ///< inlier end points, up to two a line
  std::size_t features() const { return points + lines; }
};

/// Counts residuals <= 1, laid out as the entries of `c`.
inline Support support(const Correspondences& c, std::span<const double> residuals) {
  Support s;
  const double* const start = residuals.data() + c.points;
  const double* const end = start + c.lines;
  for (std::size_t i = 0; i < c.points; ++i) s.points += residuals[i] <= 1;
  for (std::size_t i = 0; i < c.lines; ++i) {
    s.lines += start[i] <= 1 || end[i] <= 1;
    s.ends += static_cast<std::size_t>(start[i] <= 1) + static_cast<std::size_t>(end[i] <= 1);
  }
  return s;
}

/// Working memory of Ransac, kept between calls.
struct RansacScratch {
  std::vector<double> residuals;
  std::vector<double> weights;
  std::vector<std::size_t> off_plane;
};

/// One estimation: propose() any number of models, run() once. Thread: one caller at a time.
template <class Estimator>
class Ransac {
 public:
  using Model = typename Estimator::Model;

  /// Stops early once a better model than the best would have been found with this certainty.
  static constexpr double kMissProbability = 1e-4;
  static constexpr int kOptimisationSteps = 4;
  /// Residuals to compute at most: bounds the time of a hopeless candidate with many matches.
  static constexpr std::size_t kMaxResiduals = 600'000;

  Ransac(const Correspondences& c, RansacScratch& scratch)
      : c_(c), sampler_(c), residuals_(scratch.residuals), weights_(scratch.weights) {
    residuals_.resize(c.size());
    weights_.resize(c.size());
  }

  /// Offers a model from elsewhere before run().
  void propose(const Model& model) { consider(model); }

  /// The model with the highest score; none if no sample gave one.
  std::optional<Scored<Model>> run(int max_iterations, Random& random) {
    std::array<std::uint32_t, Estimator::kSampleSize> sample{};
    std::array<Model, Estimator::kMaxModels> models{};
    double miss = 1;  // probability that no sample so far was all inliers
    for (int i = 0; i < max_iterations && miss > kMissProbability; ++i) {
      if (computed_ > kMaxResiduals || !sampler_.draw(i, random, sample)) break;
      const std::size_t count = Estimator::solve(c_, sample, models);
      bool better = false;
      for (std::size_t m = 0; m < count; ++m) better |= consider(models[m]);
      if (better) miss = power(1 - hit_probability_, i);
      miss *= 1 - hit_probability_;
    }
    return best_;
  }

 private:
  // Scores `model`; if it is the best so far, optimises it and makes it the best.
  bool consider(const Model& model) {
    const double score = score_of(model, best_ ? best_->score : 0);
    if (!(score > (best_ ? best_->score : 0))) return false;
    best_ = optimised({model, score});
    Estimator::residuals(best_->model, c_, 0, c_.size(), residuals_);
    const Support s = support(c_, residuals_);
    hit_probability_ =
        power(sampler_.inlier_share(s.points, s.ends), static_cast<int>(Estimator::kSampleSize));
    return true;
  }

  Scored<Model> optimised(Scored<Model> best) {
    for (int step = 0; step < kOptimisationSteps; ++step) {
      Estimator::residuals(best.model, c_, 0, c_.size(), residuals_);
      computed_ += c_.size();
      // Wider than the tolerance at first, so that a rough model can draw in its neighbours.
      const double widening = 1.0 + 0.5 * (kOptimisationSteps - 1 - step);
      for (std::size_t i = 0; i < c_.size(); ++i)
        weights_[i] = std::max(0.0, 1 - residuals_[i] / (widening * widening));
      Model refined = best.model;
      if (!Estimator::refine(c_, weights_, refined)) break;
      const double score = score_of(refined, best.score);
      if (score > best.score) best = {refined, score};
    }
    return best;
  }

  // Score of `model`, or 0 as soon as it cannot exceed `floor`.
  double score_of(const Model& model, double floor) {
    constexpr std::size_t kChunk = 64;
    double score = 0;
    double remaining = static_cast<double>(c_.features());
    const auto hopeless = [&] { return !(score + remaining > floor); };
    for (std::size_t first = 0; first < c_.points && !hopeless(); first += kChunk) {
      const std::size_t last = std::min(first + kChunk, c_.points);
      residuals_between(model, first, last);
      for (std::size_t i = first; i < last; ++i) score += 1 - std::min(residuals_[i], 1.0);
      remaining -= static_cast<double>(last - first);
    }
    const std::size_t other = c_.lines;  // from the start of a line to its other end
    for (std::size_t first = 0; first < c_.lines && !hopeless(); first += kChunk) {
      const std::size_t last = std::min(first + kChunk, c_.lines);
      residuals_between(model, c_.points + first, c_.points + last);
      residuals_between(model, c_.points + first + other, c_.points + last + other);
      const double* const r = residuals_.data() + c_.points;
      for (std::size_t i = first; i < last; ++i)
        score += 1 - std::min(std::min(r[i], r[i + other]), 1.0);
      remaining -= static_cast<double>(last - first);
    }
    return hopeless() ? 0 : score;
  }

  void residuals_between(const Model& model, std::size_t first, std::size_t last) {
    Estimator::residuals(model, c_, first, last,
                         std::span(residuals_).subspan(first, last - first));
    computed_ += last - first;
  }

  static double power(double base, int exponent) {
    double result = 1;
    for (; exponent > 0; exponent /= 2) {
      if (exponent % 2 == 1) result *= base;
      base *= base;
    }
    return result;
  }

  const Correspondences& c_;
  Sampler sampler_;
  std::optional<Scored<Model>> best_;
  double hit_probability_ = 0;
  std::size_t computed_ = 0;
  std::vector<double>& residuals_;
  std::vector<double>& weights_;
};

}  // namespace loopd
