#include "loop/blob_store.h"

#include <gtest/gtest.h>

#include <map>
#include <vector>

#include "support/descriptor_samples.h"

namespace loopd {
namespace {

std::vector<std::byte> bytes(std::size_t n, DescriptorSamples& samples) {
  std::vector<std::byte> made(n);
  for (std::byte& b : made) b = static_cast<std::byte>(samples.below(256));
  return made;
}

std::vector<std::byte> content(const BlobStore& store, BlobStore::Blob blob, std::size_t n) {
  std::vector<std::byte> read(n);
  store.read(blob, 0, read);
  return read;
}

TEST(BlobStore, CountsItsChunks) {
  BlobStore store(10);
  EXPECT_EQ(store.free_chunks(), 10u);
  const BlobStore::Blob empty = store.allocate(0);
  EXPECT_EQ(store.free_chunks(), 9u);
  store.allocate(BlobStore::kChunkBytes);
  EXPECT_EQ(store.free_chunks(), 8u);
  store.allocate(BlobStore::kChunkBytes + 1);
  EXPECT_EQ(store.free_chunks(), 6u);
  store.release(empty, 0);
  EXPECT_EQ(store.free_chunks(), 7u);
}

TEST(BlobStore, ReadsAndWritesAnyPart) {
  DescriptorSamples samples(1);
  BlobStore store(20);
  constexpr std::size_t kSize = 5 * BlobStore::kChunkBytes + 77;
  std::vector<std::byte> expected = bytes(kSize, samples);
  const BlobStore::Blob blob = store.allocate(kSize);
  store.write(blob, 0, expected);
  for (int i = 0; i < 300; ++i) {
    const std::size_t from = samples.below(kSize);
    const std::size_t size = samples.below(static_cast<std::uint32_t>(kSize - from + 1));
    const auto part = bytes(size, samples);
    store.write(blob, from, part);
    std::copy(part.begin(), part.end(), expected.begin() + static_cast<std::ptrdiff_t>(from));
    std::vector<std::byte> back(size);
    store.read(blob, from, back);
    ASSERT_EQ(back, part);
  }
  EXPECT_EQ(content(store, blob, kSize), expected);
}

TEST(BlobStore, KeepsEveryBlobUnderAnyMixOfAllocateAndRelease) {
  DescriptorSamples samples(2);
  BlobStore store(64);
  std::map<BlobStore::Blob, std::vector<std::byte>> held;
  for (int i = 0; i < 3000; ++i) {
    const std::size_t size = samples.below(7 * BlobStore::kChunkBytes);
    if (BlobStore::chunks_for(size) <= store.free_chunks()) {
      const auto blob = store.allocate(size);
      ASSERT_FALSE(held.contains(blob));
      held[blob] = bytes(size, samples);
      store.write(blob, 0, held[blob]);
    } else {
      const auto gone =
          std::next(held.begin(), samples.below(static_cast<std::uint32_t>(held.size())));
      ASSERT_EQ(content(store, gone->first, gone->second.size()), gone->second);
      store.release(gone->first, gone->second.size());
      held.erase(gone);
    }
  }
  for (const auto& [blob, expected] : held) {
    ASSERT_EQ(content(store, blob, expected.size()), expected);
    store.release(blob, expected.size());
  }
  EXPECT_EQ(store.free_chunks(), 64u);
}

}  // namespace
}  // namespace loopd
