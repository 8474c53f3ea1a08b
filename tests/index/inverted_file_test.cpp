#include "index/inverted_file.h"

#include <gtest/gtest.h>

#include <map>

#include "support/descriptor_samples.h"

namespace loopd {
namespace {

std::vector<Posting> postings(const InvertedFile& file, std::uint32_t word) {
  std::vector<Posting> all;
  file.for_each(word, [&](const Posting& posting) { all.push_back(posting); });
  return all;
}

TEST(InvertedFile, AnUnknownWordIsInNoImage) {
  const InvertedFile file;
  EXPECT_EQ(file.images(7), 0u);
  EXPECT_TRUE(postings(file, 7).empty());
}

TEST(InvertedFile, CountsAWordSeenTwiceInOneImage) {
  InvertedFile file;
  file.reserve(1, 4);
  file.add(0, 5);
  file.add(0, 5);
  file.add(0, 9);
  EXPECT_EQ(file.images(0), 2u);
  EXPECT_EQ(postings(file, 0), (std::vector<Posting>{{5, 2}, {9, 1}}));
}

TEST(InvertedFile, KeepsTheOrderOfImagesAcrossAnyNumberOfChunks) {
  InvertedFile file;
  for (std::uint32_t images = 1; images <= 100; ++images) {
    const std::uint32_t word = images;
    file.reserve(word + 1, 2 * images);
    std::vector<Posting> expected;
    for (std::uint32_t image = 0; image < images; ++image) {
      file.add(word, image * 3);
      file.add(word, image * 3);
      expected.push_back({image * 3, 2});
    }
    ASSERT_EQ(postings(file, word), expected);
  }
}

TEST(InvertedFile, IsAMapOfListsUnderAnyMixOfAddAndRemove) {
  DescriptorSamples samples(6);
  InvertedFile file;
  std::map<std::uint32_t, std::vector<Posting>> expected;
  for (std::uint32_t image = 0; image < 400; ++image) {
    file.reserve(40, 60);
    for (int i = 0; i < 60; ++i) {
      const std::uint32_t word = samples.below(samples.below(40) + 1);
      file.add(word, image);
      auto& list = expected[word];
      if (list.empty() || list.back().image != image) list.push_back({image, 0});
      ++list.back().count;
    }
    const std::uint32_t gone = samples.below(40);
    file.remove(gone);
    expected.erase(gone);
    for (std::uint32_t word = 0; word < 40; ++word) {
      ASSERT_EQ(file.images(word), expected[word].size());
      ASSERT_EQ(postings(file, word), expected[word]);
    }
  }
}

TEST(InvertedFile, UsesTheChunksOfDeletedWordsAgain) {
  InvertedFile file;
  std::size_t bytes_after_first_round = 0;
  for (int round = 0; round < 20; ++round) {
    for (std::uint32_t word = 0; word < 10; ++word) {
      file.reserve(10, 50);
      for (std::uint32_t image = 0; image < 50; ++image) file.add(word, image);
    }
    if (round == 0) bytes_after_first_round = file.bytes();
    for (std::uint32_t word = 0; word < 10; ++word) file.remove(word);
  }
  EXPECT_EQ(file.bytes(), bytes_after_first_round);
}

}  // namespace
}  // namespace loopd
