// Speed of the word look-up and its agreement with brute force.
//
//   bench_index [--descriptors FILE] [--benchmark_...]
//
// FILE holds raw 32-byte descriptors, image after image (1500 an image is assumed); without it the
// descriptors are made: correlated bits, half of each image seen before. Agreement is judged on the
// matches that the ratio test accepts: `found_%` of those that brute force accepts, and `right_%`
// of the accepted ones that brute force accepts too.

#include <benchmark/benchmark.h>

#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <string>

#include "index/brute_force.h"
#include "index/word_table.h"
#include "support/descriptor_samples.h"

namespace loopd {
namespace {

constexpr std::size_t kPerImage = 1500;
constexpr double kRatio = 0.8;
constexpr int kMaxDistance = 64;

std::string descriptors_file;

bool accepted(const Neighbours& nearest) {
  if (!nearest.first || nearest.first->distance_bits > kMaxDistance) return false;
  return nearest.first->distance_bits == 0 || !nearest.second ||
         nearest.first->distance_bits <= kRatio * nearest.second->distance_bits;
}

/// One image's descriptors after the other; empty at the end.
class Images {
 public:
  virtual ~Images() = default;
  virtual std::vector<Descriptor> next() = 0;
};

class RecordedImages : public Images {
 public:
  explicit RecordedImages(const std::string& path) : file_(path, std::ios::binary) {}
  std::vector<Descriptor> next() override {
    std::vector<Descriptor> image(kPerImage);
    file_.read(reinterpret_cast<char*>(image.data()),
               static_cast<std::streamsize>(kPerImage * sizeof(Descriptor)));
    image.resize(static_cast<std::size_t>(file_.gcount()) / sizeof(Descriptor));
    return image;
  }

 private:
  std::ifstream file_;
};

class MadeImages : public Images {
 public:
  std::vector<Descriptor> next() override {
    std::vector<Descriptor> image;
    for (std::size_t i = 0; i < kPerImage; ++i) {
      const bool known = i % 2 == 0 && !seen_.empty();
      if (!known) seen_.push_back(samples_.correlated());
      const Descriptor& truth =
          known ? seen_[samples_.below(static_cast<std::uint32_t>(seen_.size()))] : seen_.back();
      image.push_back(samples_.noisy(truth, static_cast<int>(samples_.below(48))));
    }
    return image;
  }

 private:
  DescriptorSamples samples_{1};
  std::vector<Descriptor> seen_;
};

struct Grown {
  WordTable table;
  std::vector<Descriptor> queries;
};

// A table grown as a vocabulary grows: what matches no word becomes one.
std::unique_ptr<Grown> grow(std::size_t words) {
  std::unique_ptr<Images> images = std::make_unique<MadeImages>();
  if (!descriptors_file.empty()) images = std::make_unique<RecordedImages>(descriptors_file);
  auto grown = std::make_unique<Grown>();
  std::vector<Neighbours> nearest;
  while (grown->table.size() < words) {
    const auto image = images->next();
    if (image.empty()) return nullptr;
    nearest.resize(image.size());
    grown->table.two_nearest(image, nearest);
    grown->table.reserve(image.size());
    for (std::size_t i = 0; i < image.size(); ++i)
      if (!accepted(nearest[i])) grown->table.insert(image[i]);
  }
  grown->queries = images->next();
  grown->queries.resize(kPerImage);
  return grown;
}

// The table of that size, made once; null if the recording is too short.
Grown* grown(std::size_t words) {
  static std::map<std::size_t, std::unique_ptr<Grown>> made;
  const auto known = made.find(words);
  if (known != made.end()) return known->second.get();
  return made.emplace(words, grow(words)).first->second.get();
}

void report_agreement(benchmark::State& state, Grown& grown) {
  std::vector<Descriptor> words;
  for (std::uint32_t id = 0; id < grown.table.id_limit(); ++id)
    words.push_back(grown.table.descriptor(id));
  double by_both = 0;
  double by_oracle = 0;
  double by_table = 0;
  for (const Descriptor& query : grown.queries) {
    const Neighbours truth = brute_force_two_nearest(query, words);
    const Neighbours answer = grown.table.two_nearest(query);
    by_oracle += accepted(truth);
    by_table += accepted(answer);
    by_both += accepted(truth) && accepted(answer) && truth.first == answer.first;
  }
  state.counters["accepted"] = by_oracle;
  state.counters["found_%"] = 100 * by_both / by_oracle;
  state.counters["right_%"] = 100 * by_both / by_table;
  state.counters["read"] = grown.table.load().mean_candidates;
  state.counters["left_out"] = static_cast<double>(grown.table.load().left_out);
  state.counters["bytes/word"] =
      static_cast<double>(grown.table.bytes()) / static_cast<double>(grown.table.size());
}

void look_up_an_image(benchmark::State& state) {
  Grown* const table = grown(static_cast<std::size_t>(state.range(0)));
  if (table == nullptr) return state.SkipWithError("the recording has too few descriptors");
  std::vector<Neighbours> nearest(table->queries.size());
  for (auto _ : state) {
    table->table.two_nearest(table->queries, nearest);
    benchmark::DoNotOptimize(nearest.data());
  }
  report_agreement(state, *table);
}
BENCHMARK(look_up_an_image)
    ->Arg(1'000)
    ->Arg(10'000)
    ->Arg(50'000)
    ->Arg(100'000)
    ->Arg(200'000)
    ->Arg(1'000'000)
    ->Unit(benchmark::kMillisecond);

void insert_and_erase_an_image(benchmark::State& state) {
  Grown* const table = grown(static_cast<std::size_t>(state.range(0)));
  if (table == nullptr) return state.SkipWithError("the recording has too few descriptors");
  std::vector<std::uint32_t> ids(table->queries.size());
  for (auto _ : state) {
    table->table.reserve(table->queries.size());
    for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = table->table.insert(table->queries[i]);
    for (const std::uint32_t id : ids) table->table.erase(id);
  }
}
BENCHMARK(insert_and_erase_an_image)->Arg(10'000)->Arg(200'000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace loopd

int main(int argc, char** argv) {
  for (int i = 1; i + 1 < argc; ++i) {
    if (std::strcmp(argv[i], "--descriptors") != 0) continue;
    loopd::descriptors_file = argv[i + 1];
    std::copy(argv + i + 2, argv + argc, argv + i);
    argc -= 2;
    break;
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
