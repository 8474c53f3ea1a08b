#pragma once

#include <cassert>
#include <cstddef>
#include <span>
#include <type_traits>
#include <utility>

namespace loopd {

/// Memory of a fixed size, all zero at first; a page costs nothing until it is written. Owns an
/// anonymous mapping of its own, so that it never shares pages with the heap.
class MappedMemory {
 public:
  MappedMemory() = default;
  /// Throws std::bad_alloc if the kernel gives no address space.
  explicit MappedMemory(std::size_t bytes);
  ~MappedMemory();
  MappedMemory(MappedMemory&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}
  MappedMemory& operator=(MappedMemory&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(bytes_, other.bytes_);
    return *this;
  }

  void* data() const { return data_; }
  std::size_t bytes() const { return bytes_; }

 private:
  void* data_ = nullptr;
  std::size_t bytes_ = 0;
};

/// An array in mapped memory: its size never changes and its elements begin as zero bytes.
template <class T>
class FixedArray {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

 public:
  FixedArray() = default;
  /// Throws std::bad_alloc.
  explicit FixedArray(std::size_t size) : memory_(size * sizeof(T)), size_(size) {}
  FixedArray(FixedArray&& other) noexcept
      : memory_(std::move(other.memory_)), size_(std::exchange(other.size_, 0)) {}
  FixedArray& operator=(FixedArray&& other) noexcept {
    memory_ = std::move(other.memory_);
    std::swap(size_, other.size_);
    return *this;
  }

  std::size_t size() const { return size_; }
  T* data() const { return static_cast<T*>(memory_.data()); }
  T& operator[](std::size_t i) {
    assert(i < size_);
    return data()[i];
  }
  const T& operator[](std::size_t i) const {
    assert(i < size_);
    return data()[i];
  }
  std::span<T> first(std::size_t count) {
    assert(count <= size_);
    return {data(), count};
  }
  std::span<const T> first(std::size_t count) const {
    assert(count <= size_);
    return {data(), count};
  }

  std::size_t bytes() const { return bytes_for(size_); }
  static constexpr std::size_t bytes_for(std::size_t size) { return size * sizeof(T); }

 private:
  MappedMemory memory_;
  std::size_t size_ = 0;
};

}  // namespace loopd
