#include "index/vocabulary.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "base/hamming.h"
#include "support/descriptor_samples.h"

namespace loopd {
namespace {

// The vocabulary as its description says it, slow and obvious.
class ReferenceVocabulary {
 public:
  explicit ReferenceVocabulary(const IndexConfig& config) : config_(config) {}

  std::vector<Candidate> search(const std::vector<Descriptor>& query) const {
    std::map<ImageId, double> scores;
    for (const Descriptor& descriptor : query) {
      const auto match = find(descriptor);
      if (!match) continue;
      const auto& images = words_.at(*match).count_in;
      const double idf =
          std::log(static_cast<double>(terms_.size()) / static_cast<double>(images.size()));
      for (const auto& [image, count] : images) scores[image] += count / terms_.at(image) * idf;
    }
    std::vector<Candidate> candidates;
    for (const auto& [image, score] : scores) candidates.push_back({image, score});
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
    return candidates;
  }

  void add(ImageId image, const std::vector<Descriptor>& descriptors) {
    for (const Descriptor& descriptor : descriptors) {
      auto match = find(descriptor);
      if (!match) {
        match = next_++;
        words_[*match] = {descriptor, added_, {}};
      }
      words_[*match].count_in[image] += 1;
    }
    terms_[image] = static_cast<double>(descriptors.size());
    std::erase_if(words_, [&](const auto& item) {
      return config_.probation_images > 0 && item.second.count_in.size() == 1 &&
             added_ - item.second.born == config_.probation_images;
    });
    ++added_;
  }

  std::size_t words() const { return words_.size(); }

 private:
  struct Word {
    Descriptor descriptor;
    int born = 0;
    std::map<ImageId, double> count_in;
  };

  std::optional<int> find(const Descriptor& descriptor) const {
    std::vector<std::pair<int, int>> by_distance;
    for (const auto& [id, word] : words_)
      by_distance.emplace_back(hamming_distance(descriptor, word.descriptor), id);
    if (by_distance.empty()) return std::nullopt;
    std::sort(by_distance.begin(), by_distance.end());
    const auto [d1, id] = by_distance[0];
    if (d1 == 0) return id;
    if (d1 > config_.max_word_distance) return std::nullopt;
    if (by_distance.size() > 1 && d1 > config_.word_ratio * by_distance[1].first)
      return std::nullopt;
    return id;
  }

  IndexConfig config_;
  std::map<int, Word> words_;
  std::map<ImageId, double> terms_;
  int next_ = 0;
  int added_ = 0;
};

constexpr VocabularyCapacity kRoomy{
    .images = 1000, .words = 50'000, .posting_chunks = 20'000, .descriptors = 2000};

// A vocabulary with what its user keeps: the words of each image.
class Kept {
 public:
  explicit Kept(const IndexConfig& config, const VocabularyCapacity& capacity = kRoomy)
      : config_(config), vocabulary_(config, capacity) {}

  // As the detector does it: words that were new `probation_images` images ago end their probation.
  std::size_t add(ImageId image, const std::vector<Descriptor>& descriptors) {
    Image& added = images_.emplace_back(image, std::vector<WordId>(descriptors.size()));
    const std::size_t shared = vocabulary_.add(image, descriptors, added.words);
    const auto probation = static_cast<std::size_t>(config_.probation_images);
    if (probation == 0 || images_.size() <= probation) return shared;
    Image& judged = images_[images_.size() - 1 - probation];
    vocabulary_.end_probation(judged.id, judged.words);
    return shared;
  }

  void remove(std::size_t position) {
    vocabulary_.remove(images_[position].id, images_[position].words);
    images_.erase(images_.begin() + static_cast<std::ptrdiff_t>(position));
  }

  // What the vocabulary says of each word is what the images hold, and there is no other word.
  void expect_consistent() const {
    std::map<WordId, std::map<ImageId, std::size_t>> held;
    for (const Image& image : images_)
      for (const WordId word : image.words)
        if (word != kNoWord) ++held[word][image.id];
    ASSERT_EQ(vocabulary_.words(), held.size());
    ASSERT_EQ(vocabulary_.images(), images_.size());
    for (const auto& [word, in] : held) {
      ASSERT_EQ(vocabulary_.images_of(word), in.size());
      for (const auto& [image, count] : in) ASSERT_EQ(vocabulary_.count_in(word, image), count);
    }
  }

  Vocabulary& vocabulary() { return vocabulary_; }
  std::size_t words() const { return vocabulary_.words(); }
  std::size_t images() const { return images_.size(); }

 private:
  struct Image {
    ImageId id;
    std::vector<WordId> words;
  };
  IndexConfig config_;
  Vocabulary vocabulary_;
  std::vector<Image> images_;
};

std::vector<Candidate> search(Kept& kept, const std::vector<Descriptor>& query) {
  std::vector<Candidate> candidates{{77, 7.0}};  // must be cleared
  kept.vocabulary().search(query, candidates);
  return candidates;
}

// Some far apart words: more than 80 bits between any two.
std::vector<Descriptor> far_words(std::size_t n, std::uint64_t seed = 1) {
  DescriptorSamples samples(seed);
  std::vector<Descriptor> words;
  for (std::size_t i = 0; i < n; ++i) words.push_back(samples.independent());
  return words;
}

// Images of a walk past `places` places, again and again: each sees its place's words with noise
// and some words never seen again.
std::vector<std::vector<Descriptor>> walk(std::size_t images, std::size_t places,
                                          std::size_t per_image) {
  DescriptorSamples samples(21);
  std::vector<Descriptor> words;
  for (std::size_t i = 0; i < places * per_image; ++i) words.push_back(samples.correlated());
  std::vector<std::vector<Descriptor>> walked(images);
  for (std::size_t i = 0; i < images; ++i)
    for (std::size_t k = 0; k < per_image; ++k) {
      const Descriptor& word = words[i % places * per_image + k];
      walked[i].push_back(k % 4 == 3 ? samples.correlated()
                                     : samples.noisy(word, static_cast<int>(samples.below(30))));
    }
  return walked;
}

void expect_equal(const std::vector<Candidate>& one, const std::vector<Candidate>& two) {
  ASSERT_EQ(one.size(), two.size());
  std::map<ImageId, double> scores;
  for (const Candidate& candidate : two) scores[candidate.image] = candidate.score;
  for (const Candidate& candidate : one) {
    ASSERT_TRUE(scores.contains(candidate.image));
    ASSERT_NEAR(candidate.score, scores[candidate.image], 1e-12);
  }
}

void expect_sorted(const std::vector<Candidate>& candidates) {
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    ASSERT_TRUE(std::isfinite(candidates[i].score));
    ASSERT_GE(candidates[i].score, 0.0);
    if (i == 0) continue;
    ASSERT_TRUE(candidates[i - 1].score > candidates[i].score ||
                (candidates[i - 1].score == candidates[i].score &&
                 candidates[i - 1].image < candidates[i].image));
  }
}

TEST(Vocabulary, EmptyFindsNothing) {
  Kept vocabulary{IndexConfig{}};
  EXPECT_TRUE(search(vocabulary, far_words(5)).empty());
  EXPECT_TRUE(search(vocabulary, {}).empty());
  EXPECT_EQ(vocabulary.words(), 0u);
  EXPECT_EQ(vocabulary.images(), 0u);
}

TEST(Vocabulary, ScoresAreTfIdf) {
  const auto w = far_words(5);
  Kept vocabulary{IndexConfig{}};
  vocabulary.add(3, std::vector<Descriptor>{w[0], w[1]});
  vocabulary.add(5, std::vector<Descriptor>{w[0], w[2], w[2], w[3]});
  vocabulary.add(9, std::vector<Descriptor>{w[4]});
  EXPECT_EQ(vocabulary.words(), 5u);
  EXPECT_EQ(vocabulary.images(), 3u);

  // w0 is in two images of three, w2 in one, twice among its four descriptors.
  const auto candidates = search(vocabulary, {w[0], w[2]});
  ASSERT_EQ(candidates.size(), 2u);
  EXPECT_EQ(candidates[0].image, 5u);
  EXPECT_NEAR(candidates[0].score, 0.25 * std::log(3 / 2.0) + 0.5 * std::log(3.0), 1e-15);
  EXPECT_EQ(candidates[1].image, 3u);
  EXPECT_NEAR(candidates[1].score, 0.5 * std::log(3 / 2.0), 1e-15);

  // A word twice in the query counts twice.
  const auto twice = search(vocabulary, {w[4], w[4]});
  ASSERT_EQ(twice.size(), 1u);
  EXPECT_NEAR(twice[0].score, 2 * std::log(3.0), 1e-15);
}

TEST(Vocabulary, AWordInEveryImageStillNamesThem) {
  const auto w = far_words(1);
  Kept vocabulary{IndexConfig{}};
  for (ImageId image = 0; image < 80; ++image) vocabulary.add(image, w);
  const auto candidates = search(vocabulary, w);
  ASSERT_EQ(candidates.size(), 80u);
  for (ImageId image = 0; image < 80; ++image) {
    EXPECT_EQ(candidates[image].image, image);
    EXPECT_EQ(candidates[image].score, 0.0);
  }
  EXPECT_EQ(vocabulary.words(), 1u);
}

TEST(Vocabulary, AFirstImageWithoutFeaturesCounts) {
  const auto w = far_words(2);
  Kept vocabulary{IndexConfig{}};
  vocabulary.add(0, {});
  EXPECT_TRUE(search(vocabulary, w).empty());
  vocabulary.add(1, w);
  const auto candidates = search(vocabulary, w);
  ASSERT_EQ(candidates.size(), 1u);
  EXPECT_EQ(candidates[0].image, 1u);
  EXPECT_NEAR(candidates[0].score, std::log(2.0), 1e-15);
  EXPECT_EQ(vocabulary.images(), 2u);
}

TEST(Vocabulary, WithoutASecondWordTheDistanceAloneDecides) {
  IndexConfig config;
  config.max_word_distance = 10;
  Kept vocabulary{config};
  vocabulary.add(0, std::vector<Descriptor>(1));
  EXPECT_EQ(search(vocabulary, {Descriptor{{0x3ff, 0, 0, 0}}}).size(), 1u);  // 10 bits
  EXPECT_TRUE(search(vocabulary, {Descriptor{{0x7ff, 0, 0, 0}}}).empty());   // 11
}

TEST(Vocabulary, TheRatioDecidesBetweenTwoWords) {
  IndexConfig config;
  config.word_ratio = 0.5;
  Kept vocabulary{config};
  const Descriptor a{};
  const Descriptor b{{0xffffff, 0, 0, 0}};  // 24 bits from a
  vocabulary.add(0, std::vector<Descriptor>{a});
  EXPECT_EQ(vocabulary.words(), 1u);
  // b joins a, the only word, so that the second word has to be further away.
  vocabulary.add(1, std::vector<Descriptor>{b});
  EXPECT_EQ(vocabulary.words(), 1u);
  const Descriptor c{{0, ~0ull, 0xff, 0}};  // 72 bits from a: new
  vocabulary.add(2, std::vector<Descriptor>{c});
  EXPECT_EQ(vocabulary.words(), 2u);
  EXPECT_EQ(search(vocabulary, {Descriptor{{0, 0xffffff, 0, 0}}}).size(), 2u);  // 24 and 48: a
  EXPECT_TRUE(search(vocabulary, {Descriptor{{0, 0x1ffffff, 0, 0}}}).empty());  // 25 and 47
  EXPECT_EQ(search(vocabulary, {a}).size(), 2u);
  EXPECT_EQ(search(vocabulary, {c}).size(), 1u);
}

TEST(Vocabulary, WhatRepeatsWithinAnImageBecomesOneWord) {
  DescriptorSamples samples(2);
  const auto w = far_words(2);
  std::vector<Descriptor> image{w[0], w[1]};
  for (int i = 0; i < 20; ++i) image.push_back(samples.noisy(w[0], 12));
  Kept vocabulary{IndexConfig{}};
  vocabulary.add(0, image);
  EXPECT_EQ(vocabulary.words(), 2u);
}

TEST(Vocabulary, AWordNotSeenAgainInTimeIsDeleted) {
  const auto w = far_words(6);
  IndexConfig config;
  config.probation_images = 2;
  Kept vocabulary{config};
  vocabulary.add(0, std::vector<Descriptor>{w[0], w[1], w[1]});
  vocabulary.add(1, std::vector<Descriptor>{w[2]});
  EXPECT_EQ(vocabulary.words(), 3u);
  vocabulary.add(2, std::vector<Descriptor>{w[0]});  // just in time; w1, twice in one image, is not
  EXPECT_EQ(vocabulary.words(), 2u);
  EXPECT_TRUE(search(vocabulary, {w[1]}).empty());
  vocabulary.add(3, {});  // w2's time is up
  EXPECT_EQ(vocabulary.words(), 1u);
  for (ImageId image = 4; image < 10; ++image) vocabulary.add(image, {});
  EXPECT_EQ(vocabulary.words(), 1u);

  // The terms of an image stay what they were: n_0 = 3.
  const auto candidates = search(vocabulary, {w[0]});
  ASSERT_EQ(candidates.size(), 2u);
  EXPECT_EQ(candidates[0].image, 2u);
  EXPECT_NEAR(candidates[0].score, std::log(10 / 2.0), 1e-15);
  EXPECT_NEAR(candidates[1].score, std::log(10 / 2.0) / 3, 1e-15);

  // A new word takes over a freed id without the old postings.
  vocabulary.add(10, std::vector<Descriptor>{w[4], w[5]});
  ASSERT_EQ(search(vocabulary, {w[4]}).size(), 1u);
  EXPECT_EQ(search(vocabulary, {w[4]})[0].image, 10u);
}

TEST(Vocabulary, WithoutProbationNothingIsDeleted) {
  IndexConfig config;
  config.probation_images = 0;
  Kept vocabulary{config};
  vocabulary.add(0, far_words(50));
  for (ImageId image = 1; image < 200; ++image) vocabulary.add(image, {});
  EXPECT_EQ(vocabulary.words(), 50u);
}

TEST(Vocabulary, IsTheReferenceWhileLookUpsAreExact) {
  for (const int probation : {0, 1, 5}) {
    IndexConfig config;
    config.probation_images = probation;
    Kept vocabulary{config};
    ReferenceVocabulary reference(config);
    const auto images = walk(60, 20, 30);
    for (std::size_t i = 0; i < images.size(); ++i) {
      const auto candidates = search(vocabulary, images[i]);
      expect_sorted(candidates);
      expect_equal(candidates, reference.search(images[i]));
      vocabulary.add(static_cast<ImageId>(2 * i + 1), images[i]);
      reference.add(static_cast<ImageId>(2 * i + 1), images[i]);
      ASSERT_EQ(vocabulary.words(), reference.words());
    }
  }
}

TEST(Vocabulary, FindsThePlaceAmongManyWords) {
  IndexConfig config;
  config.probation_images = 0;
  Kept vocabulary{config};
  const std::size_t places = 80;
  const auto images = walk(2 * places, places, 100);
  std::size_t right = 0;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const auto candidates = search(vocabulary, images[i]);
    expect_sorted(candidates);
    if (i >= places) right += !candidates.empty() && candidates[0].image == i - places;
    vocabulary.add(static_cast<ImageId>(i), images[i]);
  }
  EXPECT_GT(vocabulary.words(), 4096u) << "the look-up never left the linear scan";
  EXPECT_EQ(right, places);
}

TEST(Vocabulary, AnotherVocabularyChangesNothing) {
  const auto images = walk(60, 20, 100);
  Kept alone{IndexConfig{}};
  Kept beside{IndexConfig{}};
  Kept other{IndexConfig{}};
  for (std::size_t i = 0; i < images.size(); ++i) {
    alone.add(static_cast<ImageId>(i), images[i]);
    beside.add(static_cast<ImageId>(i), images[i]);
    other.add(static_cast<ImageId>(i), far_words(100, i));
    search(other, images[i]);
    const auto one = search(alone, images[i]);
    const auto two = search(beside, images[i]);
    ASSERT_EQ(one.size(), two.size());
    for (std::size_t k = 0; k < one.size(); ++k) {
      ASSERT_EQ(one[k].image, two[k].image);
      ASSERT_EQ(one[k].score, two[k].score);  // bit for bit
    }
  }
  EXPECT_EQ(alone.vocabulary().bytes_in_use(), beside.vocabulary().bytes_in_use());
}

TEST(Vocabulary, IdenticalImagesDoNotGrowIt) {
  Kept vocabulary{IndexConfig{}};
  const auto image = walk(1, 1, 200)[0];
  vocabulary.add(0, image);
  const std::size_t words = vocabulary.words();
  for (ImageId i = 1; i < 80; ++i) vocabulary.add(i, image);
  EXPECT_EQ(vocabulary.words(), words);
  expect_sorted(search(vocabulary, image));
}

TEST(Vocabulary, SaysHowMuchAnImageSharesWithTheOneBefore) {
  const auto w = far_words(6);
  Kept vocabulary{IndexConfig{}};
  EXPECT_EQ(vocabulary.add(0, {w[0], w[1]}), 0u);
  EXPECT_EQ(vocabulary.add(1, {w[1], w[1], w[2]}), 2u);
  EXPECT_EQ(vocabulary.add(2, {w[0], w[3]}), 0u) << "w0 is in an image, but not in the one before";
  EXPECT_EQ(vocabulary.add(3, {w[0], w[3], w[4]}), 2u);
}

TEST(Vocabulary, ARemovedImageIsFoundNoMoreAndItsOwnWordsAreGone) {
  const auto w = far_words(3);
  Kept vocabulary{IndexConfig{}};
  vocabulary.add(0, {w[0], w[1]});
  vocabulary.add(1, {w[1], w[2]});
  vocabulary.remove(0);
  EXPECT_EQ(vocabulary.words(), 2u);
  EXPECT_TRUE(search(vocabulary, {w[0]}).empty());
  ASSERT_EQ(search(vocabulary, {w[1]}).size(), 1u);
  EXPECT_EQ(search(vocabulary, {w[1]})[0].image, 1u);
  vocabulary.expect_consistent();
  vocabulary.remove(0);
  EXPECT_EQ(vocabulary.words(), 0u);
  EXPECT_TRUE(search(vocabulary, {w[1]}).empty());
}

TEST(Vocabulary, CountsOfAWordAreAlwaysWhatTheImagesHold) {
  for (const int probation : {0, 1, 4}) {
    IndexConfig config;
    config.probation_images = probation;
    Kept vocabulary{config};
    DescriptorSamples samples(5);
    const auto images = walk(300, 12, 40);
    for (std::size_t i = 0; i < images.size(); ++i) {
      vocabulary.add(static_cast<ImageId>(i), images[i]);
      while (vocabulary.images() > 30 || (vocabulary.images() > 0 && samples.below(3) == 0))
        vocabulary.remove(samples.below(static_cast<std::uint32_t>(vocabulary.images())));
      vocabulary.expect_consistent();
    }
  }
}

TEST(Vocabulary, WithoutRoomForNewWordsAnImageKeepsThoseItMatches) {
  const auto w = far_words(12);
  const VocabularyCapacity small{.images = 3, .words = 8, .posting_chunks = 16, .descriptors = 8};
  Kept vocabulary{IndexConfig{}, small};
  vocabulary.add(0, {w[0], w[1], w[2], w[3], w[4]});
  vocabulary.add(1, {w[0], w[5], w[6], w[7], w[8], w[9]});
  EXPECT_EQ(vocabulary.words(), 8u);
  EXPECT_EQ(vocabulary.vocabulary().words_refused(), 2u);
  EXPECT_EQ(search(vocabulary, {w[0]}).size(), 2u);
  EXPECT_EQ(search(vocabulary, {w[7]}).size(), 1u);
  EXPECT_TRUE(search(vocabulary, {w[9]}).empty());
  vocabulary.expect_consistent();
  vocabulary.remove(0);  // makes room again
  vocabulary.add(2, {w[10], w[11]});
  EXPECT_EQ(search(vocabulary, {w[11]}).size(), 1u);
  vocabulary.expect_consistent();
}

TEST(Vocabulary, WithoutRoomForPostingsAnImageKeepsTheOthers) {
  const auto w = far_words(3);
  const VocabularyCapacity small{.images = 30, .words = 8, .posting_chunks = 0, .descriptors = 8};
  Kept vocabulary{IndexConfig{}, small};
  for (ImageId image = 0; image < 10; ++image) vocabulary.add(image, {w[0], w[1 + image % 2]});
  EXPECT_EQ(search(vocabulary, {w[0]}).size(), 6u);
  EXPECT_EQ(search(vocabulary, {w[1]}).size(), 5u);
  EXPECT_EQ(vocabulary.vocabulary().words_refused(), 4u);
  vocabulary.expect_consistent();
  for (int i = 0; i < 5; ++i) vocabulary.remove(0);
  vocabulary.expect_consistent();
}

TEST(Vocabulary, SaysWhetherThereIsRoomForAnImage) {
  const VocabularyCapacity small{.images = 2, .words = 8, .posting_chunks = 5, .descriptors = 8};
  Kept vocabulary{IndexConfig{}, small};
  EXPECT_TRUE(vocabulary.vocabulary().has_room(5));
  EXPECT_FALSE(vocabulary.vocabulary().has_room(6)) << "each may need a chunk of postings";
  vocabulary.add(0, far_words(2));
  vocabulary.add(1, far_words(2));
  EXPECT_FALSE(vocabulary.vocabulary().has_room(1)) << "two images are all";
  vocabulary.remove(1);
  EXPECT_TRUE(vocabulary.vocabulary().has_room(1));
}

TEST(VocabularyDeathTest, IdsMustGrow) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  Kept vocabulary{IndexConfig{}};
  vocabulary.add(4, {});
  EXPECT_DEATH(vocabulary.add(4, {}), "");
}

}  // namespace
}  // namespace loopd
