#pragma once

namespace loopd {

/// ln(x), the same bits on every CPU: only + - * / of IEEE doubles, no libm. Within 4e-16 of the
/// true value, absolutely below 1 and relatively above; exactly 0 for x = 1.
/// Precondition: x is a normal number, 2^-1022 <= x < infinity.
double natural_log(double x);

}  // namespace loopd
