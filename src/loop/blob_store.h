#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/fixed_array.h"

namespace loopd {

/// Byte strings of any length in memory of a fixed size: each lies in a chain of 4 KiB chunks,
/// which are used again when it is released, so that nothing fragments. Thread: const functions
/// concurrently, else one caller at a time.
class BlobStore {
 public:
  static constexpr std::size_t kChunkBytes = 4096;
  /// Names a blob until it is released.
  using Blob = std::uint32_t;

  /// Throws std::bad_alloc.
  explicit BlobStore(std::size_t chunks);

  static std::size_t chunks_for(std::size_t bytes) {
    return bytes == 0 ? 1 : (bytes + kChunkBytes - 1) / kChunkBytes;
  }
  /// Bytes of one of that capacity, reached when all of it has been used.
  static std::size_t bytes_for(std::size_t chunks);

  std::size_t chunks() const { return next_.size(); }
  std::size_t free_chunks() const { return chunks() - used_; }

  /// A blob of `bytes` of any content. Precondition: chunks_for(bytes) are free.
  Blob allocate(std::size_t bytes);
  /// Precondition: `bytes` is what it was allocated for.
  void release(Blob blob, std::size_t bytes);

  /// Precondition: offset and size lie within the blob.
  void write(Blob blob, std::size_t offset, std::span<const std::byte> bytes);
  void read(Blob blob, std::size_t offset, std::span<std::byte> bytes) const;

 private:
  struct alignas(64) Chunk {
    std::byte bytes[kChunkBytes];
  };
  template <class Visit>
  void for_each_part(Blob blob, std::size_t offset, std::size_t size, const Visit& visit) const;

  FixedArray<Chunk> data_;
  FixedArray<std::uint32_t> next_;  // of each chunk, the one behind it: in its blob or free
  std::uint32_t free_ = 0;          // the first free one of those begun; only if used_ < begun_
  std::size_t begun_ = 0;           // chunks ever used
  std::size_t used_ = 0;
};

}  // namespace loopd
