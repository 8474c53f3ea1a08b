#include "index/key_bits.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "support/descriptor_samples.h"

namespace loopd {
namespace {

std::vector<Descriptor> correlated_sample(std::size_t n) {
  DescriptorSamples samples(3);
  std::vector<Descriptor> sample;
  for (std::size_t i = 0; i < n; ++i) sample.push_back(samples.correlated());
  return sample;
}

// The position of a key's bit, found by setting one bit of a descriptor after the other.
std::set<std::size_t> positions(const KeyBits& bits, std::size_t table, std::size_t bit) {
  std::set<std::size_t> found;
  for (std::size_t at = 0; at < 256; ++at) {
    Descriptor one;
    one.words[at / 64] = std::uint64_t{1} << (at % 64);
    if (bits.bit(one, table, bit)) found.insert(at);
  }
  return found;
}

TEST(KeyBits, KeysAreTheBitsOneByOne) {
  const KeyBits bits(correlated_sample(300));
  DescriptorSamples samples(4);
  for (int i = 0; i < 50; ++i) {
    const Descriptor descriptor = samples.independent();
    for (const std::size_t length : {0u, 1u, 13u, 20u}) {
      const KeyBits::Keys keys = bits.keys(descriptor, length);
      for (std::size_t table = 0; table < KeyBits::kTables; ++table) {
        std::uint32_t expected = 0;
        for (std::size_t bit = 0; bit < length; ++bit)
          expected |= static_cast<std::uint32_t>(bits.bit(descriptor, table, bit)) << bit;
        ASSERT_EQ(keys[table], expected);
      }
    }
  }
}

TEST(KeyBits, NoBitTwiceInOneTableWhateverTheSample) {
  for (const auto& sample : {correlated_sample(500), std::vector<Descriptor>(10),
                             correlated_sample(1), std::vector<Descriptor>(70)}) {
    const KeyBits bits(sample);
    for (std::size_t table = 0; table < KeyBits::kTables; ++table) {
      std::set<std::size_t> all;
      for (std::size_t bit = 0; bit < KeyBits::kMaxBits; ++bit) {
        const auto at = positions(bits, table, bit);
        ASSERT_EQ(at.size(), 1u);
        all.insert(*at.begin());
      }
      ASSERT_EQ(all.size(), KeyBits::kMaxBits);
    }
  }
}

TEST(KeyBits, ConstantBitsAreNotChosen) {
  auto sample = correlated_sample(500);
  for (Descriptor& descriptor : sample) {
    descriptor.words[0] = 0;
    descriptor.words[2] = ~std::uint64_t{0};
  }
  const KeyBits bits(sample);
  for (std::size_t table = 0; table < KeyBits::kTables; ++table)
    for (std::size_t bit = 0; bit < KeyBits::kMaxBits; ++bit) {
      const std::size_t at = *positions(bits, table, bit).begin();
      EXPECT_TRUE(at / 64 == 1 || at / 64 == 3) << at;
    }
}

TEST(KeyBits, TheSameSampleGivesTheSameBits) {
  const KeyBits one(correlated_sample(400));
  const KeyBits two(correlated_sample(400));
  DescriptorSamples samples(5);
  for (int i = 0; i < 100; ++i) {
    const Descriptor descriptor = samples.independent();
    ASSERT_EQ(one.keys(descriptor, KeyBits::kMaxBits), two.keys(descriptor, KeyBits::kMaxBits));
  }
}

}  // namespace
}  // namespace loopd
