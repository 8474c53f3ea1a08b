#include "loop/blob_store.h"

#include <algorithm>
#include <cassert>
#include <cstring>

namespace loopd {

BlobStore::BlobStore(std::size_t chunks) : data_(chunks), next_(chunks) {}

std::size_t BlobStore::bytes_for(std::size_t chunks) {
  return FixedArray<Chunk>::bytes_for(chunks) + FixedArray<std::uint32_t>::bytes_for(chunks);
}

BlobStore::Blob BlobStore::allocate(std::size_t bytes) {
  const std::size_t wanted = chunks_for(bytes);
  assert(wanted <= free_chunks());
  Blob blob = 0;
  for (std::size_t i = 0; i < wanted; ++i) {  // from the last chunk to the first
    std::uint32_t taken = free_;
    if (used_ < begun_) {
      free_ = next_[taken];
    } else {
      taken = static_cast<std::uint32_t>(begun_++);
    }
    next_[taken] = blob;
    blob = taken;
    ++used_;
  }
  return blob;
}

void BlobStore::release(Blob blob, std::size_t bytes) {
  const std::size_t count = chunks_for(bytes);
  std::uint32_t last = blob;
  for (std::size_t i = 1; i < count; ++i) last = next_[last];
  next_[last] = free_;
  free_ = blob;
  used_ -= count;
}

template <class Visit>
void BlobStore::for_each_part(Blob blob, std::size_t offset, std::size_t size,
                              const Visit& visit) const {
  std::uint32_t chunk = blob;
  for (; offset >= kChunkBytes; offset -= kChunkBytes) chunk = next_[chunk];
  for (std::size_t done = 0; done < size; chunk = next_[chunk], offset = 0) {
    const std::size_t part = std::min(size - done, kChunkBytes - offset);
    visit(data_.data()[chunk].bytes + offset, done, part);
    done += part;
  }
}

void BlobStore::write(Blob blob, std::size_t offset, std::span<const std::byte> bytes) {
  for_each_part(blob, offset, bytes.size(), [&](std::byte* at, std::size_t done, std::size_t part) {
    std::memcpy(at, bytes.data() + done, part);
  });
}

void BlobStore::read(Blob blob, std::size_t offset, std::span<std::byte> bytes) const {
  for_each_part(blob, offset, bytes.size(),
                [&](const std::byte* at, std::size_t done, std::size_t part) {
                  std::memcpy(bytes.data() + done, at, part);
                });
}

}  // namespace loopd
