#pragma once

#include <array>
#include <cstddef>
#include <optional>

namespace loopd {

// Small fixed-size linear algebra with nothing but + - * / and sqrt, so that every CPU computes the
// same bits. All functions are pure and reentrant.

using Vec3 = std::array<double, 3>;
using Vec9 = std::array<double, 9>;
using Mat3 = std::array<double, 9>;  ///< row-major

Vec3 cross(const Vec3& a, const Vec3& b);
double dot(const Vec3& a, const Vec3& b);
Mat3 multiply(const Mat3& a, const Mat3& b);
Vec3 multiply(const Mat3& a, const Vec3& v);
Mat3 transpose(const Mat3& a);
/// Adjugate: adjugate(a) * a = determinant(a) * identity.
Mat3 adjugate(const Mat3& a);
double determinant(const Mat3& a);
/// [v]x, so that cross_matrix(v) * w = cross(v, w).
Mat3 cross_matrix(const Vec3& v);
/// `a` / its Frobenius norm; all zero if that norm is 0 or not finite.
Mat3 unit_norm(const Mat3& a);
bool all_finite(const Mat3& a);

/// Unit vector n with a * n = 0 as nearly as can be, for a matrix of rank 2 (the longest cross
/// product of two rows); none if the rank is below 2.
std::optional<Vec3> null_vector(const Mat3& a);

/// Unit eigenvector of the smallest eigenvalue of the symmetric N x N matrix `a` (row-major), by
/// cyclic Jacobi rotations. Instantiated for N = 3 and 9.
template <std::size_t N>
std::array<double, N> smallest_eigenvector(std::array<double, N * N> a);

/// The 9 - Rows unit vectors that span the null space of a Rows x 9 matrix (row-major), by
/// Gauss-Jordan elimination with full pivoting; none if its rank is below Rows.
/// Instantiated for Rows = 7 and 8.
template <std::size_t Rows>
std::optional<std::array<Vec9, 9 - Rows>> null_space(std::array<double, Rows * 9> a);

/// Real roots of a polynomial of degree 3 or less, ascending.
struct RealRoots {
  std::array<double, 3> value{};
  std::size_t count = 0;
};

/// Distinct real roots of c[0] + c[1] x + c[2] x^2 + c[3] x^3, by Newton steps kept inside the
/// brackets between the extrema. A root without a change of sign (a double root) may be left out.
RealRoots cubic_roots(const std::array<double, 4>& c);

}  // namespace loopd
