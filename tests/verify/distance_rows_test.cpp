#include "verify/distance_rows.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/hamming.h"
#include "support/descriptor_samples.h"

namespace loopd {
namespace {

class EveryForm : public ::testing::TestWithParam<RowForm> {};

std::vector<Descriptor> some(std::size_t n, DescriptorSamples& samples) {
  std::vector<Descriptor> made;
  for (std::size_t i = 0; i < n; ++i)
    made.push_back(i % 3 == 0 ? samples.independent() : samples.correlated());
  return made;
}

// Rows, the two smallest and the column minima as their description says.
TEST_P(EveryForm, IsWhatItSays) {
  DescriptorSamples samples(3);
  DistanceRows rows(GetParam());
  for (const std::size_t size : {1u, 2u, 15u, 16u, 17u, 31u, 32u, 33u, 100u, 200u, 64u, 5u}) {
    const auto others = some(size, samples);
    const auto queries = some(20, samples);
    rows.assign(others);
    std::vector<std::uint16_t> columns(size, DistanceRows::kFar);
    for (const Descriptor& query : queries) {
      const auto best = rows.compute(query);
      std::vector<std::uint16_t> expected;
      for (const Descriptor& other : others)
        expected.push_back(static_cast<std::uint16_t>(hamming_distance(query, other)));
      ASSERT_TRUE(std::ranges::equal(rows.row(), expected)) << size;
      for (std::size_t i = 0; i < size; ++i) columns[i] = std::min(columns[i], expected[i]);
      ASSERT_TRUE(std::ranges::equal(rows.column_best(), columns)) << size;
      expected.push_back(DistanceRows::kFar);
      std::ranges::sort(expected);
      ASSERT_EQ(best, (DistanceRows::BestTwo{expected[0], expected[1]})) << size;
    }
  }
}

TEST_P(EveryForm, KnowsTheExtremes) {
  const Descriptor none{}, all{{~0ull, ~0ull, ~0ull, ~0ull}};
  DistanceRows rows(GetParam());
  const std::vector<Descriptor> others(40, all);
  rows.assign(others);
  EXPECT_EQ(rows.compute(none), (DistanceRows::BestTwo{256, 256}));
  EXPECT_EQ(rows.compute(all), (DistanceRows::BestTwo{0, 0}));
  EXPECT_EQ(*std::ranges::max_element(rows.column_best()), 0);
}

TEST_P(EveryForm, OfAnEmptySetThereIsNothing) {
  DistanceRows rows(GetParam());
  rows.assign({});
  EXPECT_EQ(rows.compute(Descriptor{}), DistanceRows::BestTwo{});
  EXPECT_TRUE(rows.row().empty());
}

INSTANTIATE_TEST_SUITE_P(ThisCpu, EveryForm,
                         ::testing::ValuesIn(row_forms().begin(), row_forms().end()));

}  // namespace
}  // namespace loopd
