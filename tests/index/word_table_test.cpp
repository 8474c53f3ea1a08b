#include "index/word_table.h"

#include <gtest/gtest.h>

#include <map>
#include <string>

#include "index/brute_force.h"
#include "support/descriptor_samples.h"

namespace loopd {
namespace {

std::uint32_t insert(WordTable& table, const Descriptor& word) {
  table.reserve(1);
  return table.insert(word);
}

void fill(WordTable& table, const std::vector<Descriptor>& words) {
  for (const Descriptor& word : words) insert(table, word);
}

bool accepted(const Neighbours& nearest) {
  return nearest.first && nearest.first->distance_bits <= 64 &&
         (!nearest.second || nearest.first->distance_bits == 0 ||
          nearest.first->distance_bits <= 0.8 * nearest.second->distance_bits);
}

// Of the matches that brute force accepts by NNDR, the share the table finds; and of those it
// accepts, the share that brute force accepts.
struct Agreement {
  double found = 0;
  double right = 0;
};

Agreement agreement(WordTable& table, const std::vector<Descriptor>& words,
                    const std::vector<Descriptor>& queries) {
  std::vector<Neighbours> answers(queries.size());
  table.two_nearest(queries, answers);
  double by_oracle = 0;
  double by_table = 0;
  double by_both = 0;
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Neighbours truth = brute_force_two_nearest(queries[i], words);
    by_oracle += accepted(truth);
    by_table += accepted(answers[i]);
    by_both += accepted(truth) && accepted(answers[i]) && truth.first == answers[i].first;
  }
  EXPECT_GT(by_oracle, 100);
  return {by_both / by_oracle, by_both / by_table};
}

// Every answer is honest: real words at their real distance, in order, never nearer than the truth.
void expect_honest(WordTable& table, const std::vector<Descriptor>& words,
                   const Descriptor& query) {
  const Neighbours truth = brute_force_two_nearest(query, words);
  const Neighbours answer = table.two_nearest(query);
  if (answer.first) {
    ASSERT_EQ(answer.first->distance_bits,
              hamming_distance(query, table.descriptor(answer.first->word)));
    ASSERT_GE(answer.first->distance_bits, truth.first->distance_bits);
  }
  if (answer.second) {
    ASSERT_TRUE(answer.first);
    ASSERT_NE(answer.first->word, answer.second->word);
    ASSERT_EQ(answer.second->distance_bits,
              hamming_distance(query, table.descriptor(answer.second->word)));
    ASSERT_GE(answer.second->distance_bits, answer.first->distance_bits);
    ASSERT_GE(answer.second->distance_bits, truth.second->distance_bits);
  }
}

std::vector<Descriptor> correlated_words(std::size_t n, std::uint64_t seed) {
  DescriptorSamples samples(seed);
  std::vector<Descriptor> words;
  for (std::size_t i = 0; i < n; ++i) words.push_back(samples.correlated());
  return words;
}

std::vector<Descriptor> observations(const std::vector<Descriptor>& words, std::size_t n,
                                     std::uint32_t most_flips) {
  DescriptorSamples samples(99);
  std::vector<Descriptor> seen;
  for (std::size_t i = 0; i < n; ++i)
    seen.push_back(samples.noisy(words[samples.below(static_cast<std::uint32_t>(words.size()))],
                                 static_cast<int>(samples.below(most_flips))));
  return seen;
}

TEST(WordTable, EmptyFindsNothing) {
  WordTable table;
  EXPECT_EQ(table.two_nearest(Descriptor{}), Neighbours{});
  std::vector<Neighbours> nearest(3);
  table.two_nearest(std::vector<Descriptor>(3), nearest);
  EXPECT_EQ(nearest, std::vector<Neighbours>(3));
  table.reserve(0);
  EXPECT_EQ(table.size(), 0u);
}

TEST(WordTable, OneWordHasNoSecond) {
  WordTable table;
  const std::uint32_t id = insert(table, Descriptor{{1, 2, 3, 4}});
  const Neighbours nearest = table.two_nearest(Descriptor{});
  EXPECT_EQ(nearest.first, (Neighbour{id, 5}));
  EXPECT_FALSE(nearest.second);
}

TEST(WordTable, IsExactWhileSmall) {
  DescriptorSamples samples(1);
  const auto words = correlated_words(700, 2);
  WordTable table;
  fill(table, words);
  for (const Descriptor& query : observations(words, 300, 200))
    ASSERT_EQ(table.two_nearest(query), brute_force_two_nearest(query, words));
  for (int i = 0; i < 100; ++i) {
    const Descriptor query = samples.independent();
    ASSERT_EQ(table.two_nearest(query), brute_force_two_nearest(query, words));
  }
}

TEST(WordTable, AgreesWithBruteForceOnIndependentBits) {
  DescriptorSamples samples(7);
  std::vector<Descriptor> words;
  for (int i = 0; i < 6000; ++i) words.push_back(samples.independent());
  WordTable table;
  fill(table, words);
  ASSERT_GT(table.load().buckets, 0u);
  const Agreement result = agreement(table, words, observations(words, 600, 64));
  EXPECT_GT(result.found, 0.95);
  EXPECT_GT(result.right, 0.99);
}

TEST(WordTable, AgreesWithBruteForceOnCorrelatedBits) {
  // The second size is past where the key bits are chosen anew.
  for (const std::size_t size : {5000u, 18000u}) {
    const auto words = correlated_words(size, 8);
    WordTable table;
    fill(table, words);
    ASSERT_GT(table.load().buckets, 0u);
    const Agreement result = agreement(table, words, observations(words, 400, 64));
    EXPECT_GT(result.found, 0.95) << size;
    EXPECT_GT(result.right, 0.95) << size;
    // A small part of the words is read, or it would be no index.
    EXPECT_LT(table.load().mean_candidates, 0.2 * static_cast<double>(size));
  }
}

TEST(WordTable, AWordItselfIsAlwaysFound) {
  const auto words = correlated_words(5000, 9);
  WordTable table;
  fill(table, words);
  for (std::uint32_t id = 0; id < words.size(); ++id)
    ASSERT_EQ(table.two_nearest(words[id]).first->distance_bits, 0);
}

TEST(WordTable, BatchAndSingleLookUpsAgree) {
  const auto words = correlated_words(5000, 10);
  WordTable table;
  fill(table, words);
  const auto queries = observations(words, 500, 100);
  std::vector<Neighbours> nearest(queries.size());
  table.two_nearest(queries, nearest);
  for (std::size_t i = 0; i < queries.size(); ++i)
    ASSERT_EQ(nearest[i], table.two_nearest(queries[i]));
}

TEST(WordTable, HostileSetsStayHonestAndBounded) {
  DescriptorSamples samples(11);
  constexpr std::size_t kWords = 5000;
  std::map<std::string, std::vector<Descriptor>> sets;
  sets["all zero"] = std::vector<Descriptor>(kWords);
  sets["all equal"] = std::vector<Descriptor>(kWords, samples.independent());
  for (std::size_t i = 0; i < kWords; ++i) {
    sets["one bit apart"].push_back(samples.noisy(Descriptor{}, 1));
    sets["two values"].push_back(i % 2 == 0 ? Descriptor{}
                                            : Descriptor{{~0ull, ~0ull, ~0ull, ~0ull}});
    sets["equal, then not"].push_back(i < 2500 ? Descriptor{} : samples.correlated());
  }
  for (const auto& [name, words] : sets) {
    SCOPED_TRACE(name);
    WordTable table;
    fill(table, words);
    for (std::size_t i = 0; i < words.size(); i += 250) {
      expect_honest(table, words, words[i]);
      expect_honest(table, words, samples.noisy(words[i], 5));
      expect_honest(table, words, samples.independent());
    }
    EXPECT_EQ(table.two_nearest(words[0]).first->distance_bits, 0);
    EXPECT_LE(table.load().mean_candidates, 24 * 126 + 1);
    for (std::uint32_t id = 0; id < kWords; ++id) table.erase(id);
    EXPECT_EQ(table.size(), 0u);
    EXPECT_EQ(table.two_nearest(words[0]), Neighbours{});
  }
}

TEST(WordTable, FreedIdsAreReusedTheLastFirst) {
  WordTable table;
  const auto words = correlated_words(10, 12);
  fill(table, words);
  table.erase(3);
  table.erase(7);
  EXPECT_EQ(table.size(), 8u);
  EXPECT_NE(table.two_nearest(words[3]).first->word, 3u);
  EXPECT_EQ(insert(table, words[3]), 7u);
  EXPECT_EQ(insert(table, words[7]), 3u);
  EXPECT_EQ(table.two_nearest(words[3]).first, (Neighbour{7, 0}));
  EXPECT_EQ(insert(table, words[0]), 10u);
}

TEST(WordTable, ChurnLosesNothingAndInventsNothing) {
  DescriptorSamples samples(13);
  WordTable table;
  std::map<std::uint32_t, Descriptor> expected;
  std::size_t bytes_at_half = 0;
  for (int round = 0; round < 60; ++round) {
    // Grows past both sizes at which bits are chosen, then stays.
    const int inserted = round < 30 ? 900 : 600;
    table.reserve(static_cast<std::size_t>(inserted));
    for (int i = 0; i < inserted; ++i) {
      const Descriptor word = i % 10 == 0 ? Descriptor{} : samples.correlated();
      const std::uint32_t id = table.insert(word);
      ASSERT_TRUE(expected.emplace(id, word).second) << "id " << id << " is in use";
    }
    const std::uint32_t limit = static_cast<std::uint32_t>(table.id_limit());
    for (int erased = 0; erased < (round < 30 ? 300 : 600);) {
      const std::uint32_t id = samples.below(limit);
      if (expected.erase(id) == 0) continue;
      table.erase(id);
      ++erased;
    }
    ASSERT_EQ(table.size(), expected.size());
    for (int i = 0; i < 20; ++i) {
      const auto known = expected.lower_bound(samples.below(limit));
      if (known == expected.end()) continue;
      const Neighbours nearest = table.two_nearest(known->second);
      ASSERT_EQ(nearest.first->distance_bits, 0);
      ASSERT_EQ(expected.at(nearest.first->word), known->second);
      ASSERT_TRUE(!nearest.second || expected.contains(nearest.second->word));
    }
    if (round == 40) bytes_at_half = table.bytes();
  }
  EXPECT_EQ(table.bytes(), bytes_at_half) << "memory grows although the number of words does not";
  for (const auto& [id, word] : expected) ASSERT_EQ(table.descriptor(id), word);
  for (const auto& [id, word] : expected) table.erase(id);
  EXPECT_EQ(table.size(), 0u);
  EXPECT_EQ(table.load().left_out, 0u);
}

TEST(WordTable, TheSameCallsGiveTheSameAnswers) {
  const auto words = correlated_words(6000, 14);
  const auto queries = observations(words, 300, 120);
  const auto answers = [&] {
    WordTable table;
    fill(table, words);
    for (std::uint32_t id = 0; id < 6000; id += 3) table.erase(id);
    fill(table, std::vector<Descriptor>(words.begin(), words.begin() + 1000));
    std::vector<Neighbours> nearest(queries.size());
    table.two_nearest(queries, nearest);
    return nearest;
  };
  EXPECT_EQ(answers(), answers());
}

TEST(WordTable, ReservedInsertionsAllocateNothing) {
  const auto words = correlated_words(9000, 15);
  WordTable table;
  for (std::size_t start = 0; start < words.size(); start += 1500) {
    table.reserve(1500);
    const std::size_t bytes = table.bytes();
    for (std::size_t i = 0; i < 1500; ++i) table.insert(words[start + i]);
    ASSERT_LE(table.bytes(), bytes);  // less once the key bits are chosen
  }
}

}  // namespace
}  // namespace loopd
