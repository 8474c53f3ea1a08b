#include "features/simd.h"

#include <array>
#include <cstddef>

namespace loopd {

std::span<const SimdForm> simd_forms() {
  static constexpr std::array kForms{SimdForm::kBaseline, SimdForm::kAvx2};
#if defined(__x86_64__)
  static const std::size_t count = __builtin_cpu_supports("avx2") != 0 ? 2 : 1;
#else
  static const std::size_t count = 1;
#endif
  return {kForms.data(), count};
}

}  // namespace loopd
