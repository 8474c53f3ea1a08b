#include "verify/linear.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace loopd {
namespace {

// Pivots are compared with entries of order 1 (coordinates are normalised before).
constexpr double kSmallestPivot = 1e-10;
constexpr int kMaxSweeps = 30;
constexpr int kMaxRootSteps = 200;

double squared_norm(const Vec3& v) { return dot(v, v); }

void append_root(RealRoots& roots, double x) {
  if (std::isfinite(x) && roots.count < roots.value.size()) roots.value[roots.count++] = x;
}

RealRoots quadratic_roots(double c0, double c1, double c2) {
  RealRoots roots;
  const double scale = std::max(std::abs(c0), std::abs(c1));
  if (!(std::abs(c2) > 1e-14 * scale)) {
    if (c1 != 0) append_root(roots, -c0 / c1);
    return roots;
  }
  const double discriminant = c1 * c1 - 4 * c2 * c0;
  if (!(discriminant >= 0)) return roots;
  const double q = -0.5 * (c1 + (c1 < 0 ? -1.0 : 1.0) * std::sqrt(discriminant));
  const double first = q / c2;
  const double second = q != 0 ? c0 / q : first;
  append_root(roots, std::min(first, second));
  if (first != second) append_root(roots, std::max(first, second));
  return roots;
}

// Monic cubic x^3 + a x^2 + b x + c.
struct MonicCubic {
  double a, b, c;
  double at(double x) const { return ((x + a) * x + b) * x + c; }
  double slope(double x) const { return (3 * x + 2 * a) * x + b; }
};

// The root between `low` and `high`, where the cubic is monotone and changes its sign.
double bracketed_root(const MonicCubic& f, double low, double high) {
  const bool rises = f.at(high) > 0;
  double x = 0.5 * (low + high);
  for (int step = 0; step < kMaxRootSteps; ++step) {
    const double value = f.at(x);
    if (value == 0) return x;
    ((value > 0) == rises ? high : low) = x;
    double next = x - value / f.slope(x);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (next == x || next == low || next == high) return next;
    x = next;
  }
  return x;
}

void append_root_between(RealRoots& roots, const MonicCubic& f, double low, double high) {
  const double at_low = f.at(low), at_high = f.at(high);
  if ((at_low < 0 && at_high > 0) || (at_low > 0 && at_high < 0))
    append_root(roots, bracketed_root(f, low, high));
}

// Zeroes a[p][q] of the symmetric `a` by a rotation and turns the columns of `v` with it.
template <std::size_t N>
void jacobi_rotate(std::array<double, N * N>& a, std::array<double, N * N>& v, std::size_t p,
                   std::size_t q) {
  const double apq = a[p * N + q];
  const double theta = (a[q * N + q] - a[p * N + p]) / (2 * apq);
  const double t = (theta < 0 ? -1.0 : 1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1));
  const double c = 1 / std::sqrt(t * t + 1), s = t * c;
  for (std::size_t k = 0; k < N; ++k) {
    const double x = a[k * N + p], y = a[k * N + q];
    a[k * N + p] = c * x - s * y;
    a[k * N + q] = s * x + c * y;
  }
  for (std::size_t k = 0; k < N; ++k) {
    const double x = a[p * N + k], y = a[q * N + k];
    a[p * N + k] = c * x - s * y;
    a[q * N + k] = s * x + c * y;
    const double g = v[p * N + k], h = v[q * N + k];
    v[p * N + k] = c * g - s * h;
    v[q * N + k] = s * g + c * h;
  }
}

// The largest entry of the rows and columns from `from` on; swaps it to (from, from).
template <std::size_t Rows>
void pivot(std::array<double, Rows * 9>& a, std::array<std::size_t, 9>& columns, std::size_t from) {
  std::size_t best_row = from, best_column = from;
  for (std::size_t r = from; r < Rows; ++r)
    for (std::size_t c = from; c < 9; ++c)
      if (std::abs(a[r * 9 + c]) > std::abs(a[best_row * 9 + best_column])) {
        best_row = r;
        best_column = c;
      }
  if (best_row != from)
    for (std::size_t c = 0; c < 9; ++c) std::swap(a[best_row * 9 + c], a[from * 9 + c]);
  if (best_column != from) {
    for (std::size_t r = 0; r < Rows; ++r) std::swap(a[r * 9 + best_column], a[r * 9 + from]);
    std::swap(columns[best_column], columns[from]);
  }
}

Vec9 unit_norm9(Vec9 v) {
  double sum = 0;
  for (const double x : v) sum += x * x;
  const double norm = std::sqrt(sum);
  for (double& x : v) x /= norm;
  return v;
}

}  // namespace

Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Mat3 multiply(const Mat3& a, const Mat3& b) {
  Mat3 out{};
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c)
      out[r * 3 + c] = a[r * 3] * b[c] + a[r * 3 + 1] * b[3 + c] + a[r * 3 + 2] * b[6 + c];
  return out;
}

Vec3 multiply(const Mat3& a, const Vec3& v) {
  return {a[0] * v[0] + a[1] * v[1] + a[2] * v[2], a[3] * v[0] + a[4] * v[1] + a[5] * v[2],
          a[6] * v[0] + a[7] * v[1] + a[8] * v[2]};
}

Mat3 transpose(const Mat3& a) { return {a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]}; }

Mat3 adjugate(const Mat3& a) {
  return {a[4] * a[8] - a[5] * a[7], a[2] * a[7] - a[1] * a[8], a[1] * a[5] - a[2] * a[4],
          a[5] * a[6] - a[3] * a[8], a[0] * a[8] - a[2] * a[6], a[2] * a[3] - a[0] * a[5],
          a[3] * a[7] - a[4] * a[6], a[1] * a[6] - a[0] * a[7], a[0] * a[4] - a[1] * a[3]};
}

double determinant(const Mat3& a) {
  return a[0] * (a[4] * a[8] - a[5] * a[7]) - a[1] * (a[3] * a[8] - a[5] * a[6]) +
         a[2] * (a[3] * a[7] - a[4] * a[6]);
}

Mat3 cross_matrix(const Vec3& v) { return {0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0}; }

Mat3 unit_norm(const Mat3& a) {
  double sum = 0;
  for (const double x : a) sum += x * x;
  const double norm = std::sqrt(sum);
  if (!(norm > 0) || !std::isfinite(norm)) return Mat3{};
  Mat3 out = a;
  for (double& x : out) x /= norm;
  return out;
}

bool all_finite(const Mat3& a) {
  return std::all_of(a.begin(), a.end(), [](double x) { return std::isfinite(x); });
}

std::optional<Vec3> null_vector(const Mat3& a) {
  const Vec3 r0{a[0], a[1], a[2]}, r1{a[3], a[4], a[5]}, r2{a[6], a[7], a[8]};
  Vec3 best = cross(r0, r1);
  for (const Vec3& other : {cross(r0, r2), cross(r1, r2)})
    if (squared_norm(other) > squared_norm(best)) best = other;
  const double norm = std::sqrt(squared_norm(best));
  if (!(norm > 1e-14) || !std::isfinite(norm)) return std::nullopt;
  return Vec3{best[0] / norm, best[1] / norm, best[2] / norm};
}

template <std::size_t N>
std::array<double, N> smallest_eigenvector(std::array<double, N * N> a) {
  std::array<double, N * N> v{};  // row i becomes the eigenvector of a[i][i]
  for (std::size_t i = 0; i < N; ++i) v[i * N + i] = 1;
  double trace = 0;
  for (std::size_t i = 0; i < N; ++i) trace += std::abs(a[i * N + i]);
  const double negligible = trace * 1e-16;
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    bool turned = false;
    for (std::size_t p = 0; p + 1 < N; ++p)
      for (std::size_t q = p + 1; q < N; ++q)
        if (std::abs(a[p * N + q]) > negligible) {
          jacobi_rotate<N>(a, v, p, q);
          turned = true;
        }
    if (!turned) break;
  }
  std::size_t best = 0;
  for (std::size_t i = 1; i < N; ++i)
    if (a[i * N + i] < a[best * N + best]) best = i;
  std::array<double, N> out{};
  for (std::size_t k = 0; k < N; ++k) out[k] = v[best * N + k];
  return out;
}

template std::array<double, 3> smallest_eigenvector<3>(std::array<double, 9>);
template std::array<double, 9> smallest_eigenvector<9>(std::array<double, 81>);

template <std::size_t Rows>
std::optional<std::array<Vec9, 9 - Rows>> null_space(std::array<double, Rows * 9> a) {
  std::array<std::size_t, 9> columns{0, 1, 2, 3, 4, 5, 6, 7, 8};
  for (std::size_t i = 0; i < Rows; ++i) {
    pivot<Rows>(a, columns, i);
    const double head = a[i * 9 + i];
    if (!(std::abs(head) > kSmallestPivot)) return std::nullopt;
    for (std::size_t c = i; c < 9; ++c) a[i * 9 + c] /= head;
    for (std::size_t r = 0; r < Rows; ++r) {
      const double factor = a[r * 9 + i];
      if (r == i || factor == 0) continue;
      for (std::size_t c = i; c < 9; ++c) a[r * 9 + c] -= factor * a[i * 9 + c];
    }
  }
  std::array<Vec9, 9 - Rows> out{};
  for (std::size_t n = 0; n < 9 - Rows; ++n) {
    Vec9 v{};
    v[columns[Rows + n]] = 1;
    for (std::size_t r = 0; r < Rows; ++r) v[columns[r]] = -a[r * 9 + Rows + n];
    out[n] = unit_norm9(v);
  }
  return out;
}

template std::optional<std::array<Vec9, 2>> null_space<7>(std::array<double, 63>);
template std::optional<std::array<Vec9, 1>> null_space<8>(std::array<double, 72>);

RealRoots cubic_roots(const std::array<double, 4>& c) {
  const double scale = std::max({std::abs(c[0]), std::abs(c[1]), std::abs(c[2])});
  if (!(std::abs(c[3]) > 1e-14 * scale)) return quadratic_roots(c[0], c[1], c[2]);
  const MonicCubic f{c[2] / c[3], c[1] / c[3], c[0] / c[3]};
  // Cauchy's bound of the roots.
  const double bound = 1 + std::max({std::abs(f.a), std::abs(f.b), std::abs(f.c)});
  RealRoots roots;
  if (!std::isfinite(bound)) return roots;
  const double discriminant = f.a * f.a - 3 * f.b;
  if (!(discriminant > 0)) {
    append_root_between(roots, f, -bound, bound);
    return roots;
  }
  const double spread = std::sqrt(discriminant);
  const double first = (-f.a - spread) / 3, second = (-f.a + spread) / 3;
  append_root_between(roots, f, -bound, first);
  append_root_between(roots, f, first, second);
  append_root_between(roots, f, second, bound);
  return roots;
}

}  // namespace loopd
