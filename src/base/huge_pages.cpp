#include "base/huge_pages.h"

#include <sys/mman.h>

#include <cstdint>

namespace loopd {
namespace {

constexpr std::uintptr_t kHugePage = std::uintptr_t{2} << 20U;

}  // namespace

void advise_huge_pages(void* data, std::size_t bytes) {
  const auto start = reinterpret_cast<std::uintptr_t>(data);
  const std::uintptr_t first = (start + kHugePage - 1) / kHugePage * kHugePage;
  const std::uintptr_t end = (start + bytes) / kHugePage * kHugePage;
  if (first >= end) return;
  static_cast<void>(::madvise(reinterpret_cast<void*>(first), end - first, MADV_HUGEPAGE));
}

}  // namespace loopd
