#include "index/inverted_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <vector>

#include "support/descriptor_samples.h"

namespace loopd {
namespace {

using Counts = std::map<std::uint32_t, std::uint32_t>;  // by image

Counts postings(const InvertedFile& file, std::uint32_t word) {
  Counts all;
  file.for_each(word, [&](const Posting& posting) {
    EXPECT_TRUE(all.emplace(posting.image, posting.count).second) << "an image twice";
  });
  EXPECT_EQ(all.size(), file.images(word));
  return all;
}

TEST(InvertedFile, AnUnusedWordIsInNoImage) {
  const InvertedFile file(8, 0);
  EXPECT_EQ(file.images(7), 0u);
  EXPECT_TRUE(postings(file, 7).empty());
  EXPECT_FALSE(file.last_is(7, 0));
}

TEST(InvertedFile, CountsAWordSeenTwiceInOneImage) {
  InvertedFile file(1, 4);
  file.add(0, 5);
  file.add(0, 5);
  file.add(0, 9);
  EXPECT_EQ(postings(file, 0), (Counts{{5, 2}, {9, 1}}));
  EXPECT_TRUE(file.last_is(0, 9));
  EXPECT_FALSE(file.last_is(0, 5));
}

TEST(InvertedFile, HoldsAnyNumberOfImages) {
  for (std::uint32_t images = 1; images <= 100; ++images) {
    InvertedFile file(1, 8);
    Counts expected;
    for (std::uint32_t image = 0; image < images; ++image) {
      file.add(0, image * 3);
      file.add(0, image * 3);
      expected[image * 3] = 2;
    }
    ASSERT_EQ(postings(file, 0), expected);
    ASSERT_TRUE(file.last_is(0, (images - 1) * 3));
  }
}

TEST(InvertedFile, HoldsTheLargestImageNumberAndTheLargestCount) {
  InvertedFile file(1, 1);
  for (std::uint32_t i = 0; i < Posting::kMaxCount + 5; ++i) file.add(0, Posting::kMaxImages - 1);
  EXPECT_EQ(postings(file, 0), (Counts{{Posting::kMaxImages - 1, Posting::kMaxCount}}));
}

TEST(InvertedFile, RefusesWhatNeedsAChunkWhenNoneIsFree) {
  InvertedFile file(2, 1);
  for (std::uint32_t image = 0; image < 21; ++image) ASSERT_TRUE(file.add(0, image)) << image;
  EXPECT_FALSE(file.add(0, 21));
  EXPECT_EQ(file.images(0), 21u);
  EXPECT_TRUE(file.add(0, 20)) << "its posting is there";
  for (std::uint32_t image = 0; image < 6; ++image) ASSERT_TRUE(file.add(1, image));
  EXPECT_FALSE(file.add(1, 6));
  for (std::uint32_t image = 0; image < 15; ++image) file.remove(0, image);
  EXPECT_TRUE(file.add(1, 6));
}

TEST(InvertedFile, IsAMapOfCountsUnderAnyMixOfAddAndRemove) {
  constexpr std::uint32_t kWords = 40;
  DescriptorSamples samples(6);
  InvertedFile file(kWords, 400);
  std::map<std::uint32_t, Counts> expected;
  for (std::uint32_t image = 0; image < 1000; ++image) {
    for (int i = 0; i < 60; ++i) {
      const std::uint32_t word = samples.below(samples.below(kWords) + 1);
      file.add(word, image);
      ++expected[word][image];
    }
    // Some 60 images stay; now and then a word is emptied altogether.
    for (std::uint32_t word = 0; word < kWords; ++word) {
      Counts& counts = expected[word];
      const bool all = samples.below(50) == 0;
      while (!counts.empty() && (all || counts.size() > 60 || samples.below(4) == 0)) {
        const auto gone =
            std::next(counts.begin(), samples.below(static_cast<std::uint32_t>(counts.size())));
        ASSERT_EQ(file.remove(word, gone->first), counts.size() - 1);
        counts.erase(gone);
      }
      ASSERT_EQ(file.remove(word, image + 1), counts.size()) << "an image it was never in";
      ASSERT_EQ(postings(file, word), counts);
    }
  }
  for (std::uint32_t word = 0; word < kWords; ++word)
    while (!expected[word].empty()) {
      file.remove(word, expected[word].begin()->first);
      expected[word].erase(expected[word].begin());
    }
  EXPECT_EQ(file.free_chunks(), 400u) << "chunks were lost";
}

}  // namespace
}  // namespace loopd
