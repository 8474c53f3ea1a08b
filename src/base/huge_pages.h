#pragma once

#include <cstddef>
#include <new>

namespace loopd {

/// Asks the kernel to back the whole huge pages in [data, data + bytes) by huge pages as they are
/// touched. A wish: where it cannot be granted nothing happens. Touches nothing. Thread-safe.
void advise_huge_pages(void* data, std::size_t bytes);

/// Allocator of large arrays that are read at random: with small pages nearly every read would miss
/// the TLB. Standard otherwise.
template <class T>
struct HugePageAllocator {
  using value_type = T;

  HugePageAllocator() = default;
  template <class U>
  explicit HugePageAllocator(const HugePageAllocator<U>& /*other*/) {}

  T* allocate(std::size_t n) {
    void* const data = ::operator new(n * sizeof(T), std::align_val_t{alignof(T)});
    advise_huge_pages(data, n * sizeof(T));
    return static_cast<T*>(data);
  }
  void deallocate(T* data, std::size_t n) noexcept {
    ::operator delete(data, n * sizeof(T), std::align_val_t{alignof(T)});
  }
  friend bool operator==(const HugePageAllocator&, const HugePageAllocator&) = default;
};

}  // namespace loopd
