#include "base/hamming.h"

#include <gtest/gtest.h>

#include <bitset>
#include <vector>

#include "support/descriptor_samples.h"

namespace loopd {
namespace {

int bit_by_bit(const Descriptor& a, const Descriptor& b) {
  std::size_t sum = 0;
  for (std::size_t i = 0; i < 4; ++i) sum += std::bitset<64>(a.words[i] ^ b.words[i]).count();
  return static_cast<int>(sum);
}

// Random ones, close ones, and those whose counts are extreme.
std::vector<Descriptor> table() {
  DescriptorSamples samples(1);
  std::vector<Descriptor> table{
      {}, {{~0ull, ~0ull, ~0ull, ~0ull}}, {{~0ull, 0, 0, 0}}, {{0, 0, 0, 1ull << 63}}};
  for (int i = 0; i < 100; ++i) table.push_back(samples.independent());
  for (int i = 0; i < 100; ++i) table.push_back(samples.noisy(table[0], i));
  return table;
}

TEST(Hamming, CountsTheDifferingBits) {
  const auto others = table();
  for (const Descriptor& a : others)
    for (const Descriptor& b : others) ASSERT_EQ(hamming_distance(a, b), bit_by_bit(a, b));
  EXPECT_EQ(hamming_distance(others[0], others[1]), 256);
}

TEST(Hamming, ThePortableFormComesFirstAndAllHaveNames) {
  ASSERT_FALSE(hamming_forms().empty());
  EXPECT_EQ(hamming_forms()[0], HammingForm::kPortable);
  for (const HammingForm form : hamming_forms()) EXPECT_NE(hamming_form_name(form), "unknown");
}

TEST(Hamming, EveryFormGivesTheSameBatch) {
  const auto others = table();
  for (const HammingForm form : hamming_forms())
    for (std::size_t n = 0; n <= others.size(); n += n < 20 ? 1 : 37) {
      std::vector<std::uint16_t> distances(n, 999);
      hamming_distances(form, others[7], std::span(others).first(n), distances);
      for (std::size_t i = 0; i < n; ++i)
        ASSERT_EQ(distances[i], bit_by_bit(others[7], others[i])) << hamming_form_name(form);
    }
}

TEST(Hamming, EveryFormGivesTheSameGather) {
  const auto others = table();
  DescriptorSamples samples(2);
  for (const HammingForm form : hamming_forms())
    for (std::size_t n = 0; n <= 300; n += n < 20 ? 1 : 37) {
      std::vector<std::uint32_t> ids(n);
      for (auto& id : ids) id = samples.below(static_cast<std::uint32_t>(others.size()));
      std::vector<std::uint16_t> distances(n, 999);
      hamming_distances_at(form, others[9], others.data(), ids, distances);
      for (std::size_t i = 0; i < n; ++i)
        ASSERT_EQ(distances[i], bit_by_bit(others[9], others[ids[i]])) << hamming_form_name(form);
    }
}

TEST(Hamming, TheDefaultIsOneOfTheForms) {
  const auto others = table();
  std::vector<std::uint16_t> portable(others.size());
  std::vector<std::uint16_t> used(others.size());
  hamming_distances(HammingForm::kPortable, others[3], others, portable);
  hamming_distances(others[3], others, used);
  EXPECT_EQ(used, portable);
  const std::vector<std::uint32_t> ids{5, 5, 0, 203, 1};
  std::vector<std::uint16_t> at(ids.size());
  hamming_distances_at(others[3], others.data(), ids, at);
  for (std::size_t i = 0; i < ids.size(); ++i) EXPECT_EQ(at[i], portable[ids[i]]);
}

}  // namespace
}  // namespace loopd
