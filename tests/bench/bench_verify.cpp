// Time of one verification, by image content: a true loop, a false candidate with many wrong
// matches (the worst), one without (the usual), and the point matcher alone.

#include <benchmark/benchmark.h>

#include <vector>

#include "verify/point_matching.h"
#include "verify/scene.h"
#include "verify/verifier.h"

namespace loopd {
namespace {

using testing::make_scene;
using testing::SceneOptions;

SceneOptions full_image(double outliers) {
  SceneOptions options;
  options.points = 1500;
  options.lines = 300;
  options.outliers = outliers;
  return options;
}

void verify(benchmark::State& state, const Features& query, const Features& match) {
  Verifier verifier({});
  InlierPairs pairs;
  Verification v;
  for (auto _ : state) {
    v = verifier.verify(query, match, 1, pairs);
    benchmark::DoNotOptimize(v);
  }
  state.counters["matches"] = v.matches();
  state.counters["inliers"] = v.inliers();
}

// 1500 points and 300 lines, all matched; the argument is the share of wrong matches in percent.
void BM_VerifyAllMatched(benchmark::State& state) {
  const auto scene = make_scene(full_image(static_cast<double>(state.range(0)) / 100));
  verify(state, scene.query, scene.match);
}
BENCHMARK(BM_VerifyAllMatched)->Arg(0)->Arg(30)->Arg(70)->Arg(100)->Unit(benchmark::kMillisecond);

// 1500 points and 300 lines an image, of which few find a partner: 200 and 40 matches.
void BM_VerifyFewMatched(benchmark::State& state) {
  SceneOptions options;
  options.points = 200;
  options.lines = 40;
  options.outliers = static_cast<double>(state.range(0)) / 100;
  auto scene = make_scene(options);
  for (auto* features : {&scene.query, &scene.match}) {
    const Features other = testing::random_features(1300, 260, features == &scene.query ? 7 : 8);
    features->points.insert(features->points.end(), other.points.begin(), other.points.end());
    features->point_descriptors.insert(features->point_descriptors.end(),
                                       other.point_descriptors.begin(),
                                       other.point_descriptors.end());
    features->lines.insert(features->lines.end(), other.lines.begin(), other.lines.end());
    features->line_descriptors.insert(features->line_descriptors.end(),
                                      other.line_descriptors.begin(), other.line_descriptors.end());
  }
  verify(state, scene.query, scene.match);
}
BENCHMARK(BM_VerifyFewMatched)->Arg(0)->Arg(30)->Arg(70)->Arg(100)->Unit(benchmark::kMillisecond);

void BM_VerifyUnrelated(benchmark::State& state) {
  verify(state, testing::random_features(1500, 300, 1), testing::random_features(1500, 300, 2));
}
BENCHMARK(BM_VerifyUnrelated)->Unit(benchmark::kMillisecond);

void BM_MatchPoints(benchmark::State& state) {
  const auto scene = make_scene(full_image(0));
  PointMatcher matcher;
  std::vector<FeatureMatch> matches;
  for (auto _ : state) {
    matcher.match(scene.query.point_descriptors, scene.match.point_descriptors, {}, matches);
    benchmark::DoNotOptimize(matches.data());
  }
}
BENCHMARK(BM_MatchPoints)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace loopd

BENCHMARK_MAIN();
