#include "verify/linear.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "verify/scene.h"

namespace loopd {
namespace {

using testing::uniform;

std::array<double, 4> cubic_with_roots(double a, double b, double c, double scale) {
  return {-a * b * c * scale, (a * b + a * c + b * c) * scale, -(a + b + c) * scale, scale};
}

TEST(CubicRoots, FindsThreeKnownRoots) {
  Random random(1);
  for (int n = 0; n < 1000; ++n) {
    std::array<double, 3> truth{uniform(random, -5, -1), uniform(random, -0.9, 0.9),
                                uniform(random, 1, 50)};
    const RealRoots found =
        cubic_roots(cubic_with_roots(truth[0], truth[1], truth[2], uniform(random, -3, -0.1)));
    ASSERT_EQ(found.count, 3u);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(found.value[i], truth[i], 1e-8);
  }
}

TEST(CubicRoots, FindsTheOnlyRoot) {
  // (x - 2)(x^2 + 1)
  const RealRoots found = cubic_roots({-2, 1, -2, 1});
  ASSERT_EQ(found.count, 1u);
  EXPECT_NEAR(found.value[0], 2, 1e-12);
}

TEST(CubicRoots, LowerDegrees) {
  const RealRoots two = cubic_roots({6, -5, 1, 0});
  ASSERT_EQ(two.count, 2u);
  EXPECT_NEAR(two.value[0], 2, 1e-12);
  EXPECT_NEAR(two.value[1], 3, 1e-12);
  const RealRoots one = cubic_roots({-3, 2, 0, 0});
  ASSERT_EQ(one.count, 1u);
  EXPECT_NEAR(one.value[0], 1.5, 1e-12);
  EXPECT_EQ(cubic_roots({1, 0, 1, 0}).count, 0u);
  EXPECT_EQ(cubic_roots({1, 0, 0, 0}).count, 0u);
  EXPECT_EQ(cubic_roots({0, 0, 0, 0}).count, 0u);
}

TEST(CubicRoots, HostileCoefficientsEnd) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(cubic_roots({nan, 1, 1, 1}).count, 0u);
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(cubic_roots({infinity, 1, 1, 1}).count, 0u);
  for (const double tiny : {1e-300, 1e-100, 1e-13}) {
    const RealRoots found = cubic_roots({1, -2, 0.5, tiny});
    for (std::size_t i = 0; i < found.count; ++i) EXPECT_TRUE(std::isfinite(found.value[i]));
  }
}

template <std::size_t Rows>
void expect_null_space() {
  Random random(Rows);
  for (int n = 0; n < 200; ++n) {
    std::array<double, Rows * 9> a{};
    for (double& x : a) x = uniform(random, -1, 1);
    const auto basis = null_space<Rows>(a);
    ASSERT_TRUE(basis.has_value());
    for (const Vec9& v : *basis) {
      double norm = 0;
      for (const double x : v) norm += x * x;
      EXPECT_NEAR(norm, 1, 1e-12);
      for (std::size_t r = 0; r < Rows; ++r) {
        double sum = 0;
        for (std::size_t c = 0; c < 9; ++c) sum += a[r * 9 + c] * v[c];
        EXPECT_NEAR(sum, 0, 1e-9);
      }
    }
  }
}

TEST(NullSpace, IsOrthogonalToEveryRow) {
  expect_null_space<7>();
  expect_null_space<8>();
}

TEST(NullSpace, LowRankIsRefused) {
  Random random(3);
  std::array<double, 63> a{};
  for (double& x : a) x = uniform(random, -1, 1);
  for (std::size_t c = 0; c < 9; ++c) a[6 * 9 + c] = a[c] + a[9 + c];
  EXPECT_FALSE(null_space<7>(a).has_value());
  EXPECT_FALSE(null_space<7>({}).has_value());
  a.fill(std::numeric_limits<double>::quiet_NaN());
  EXPECT_FALSE(null_space<7>(a).has_value());
}

TEST(SmallestEigenvector, OfAGramMatrixIsTheDirectionThatMattersLeast) {
  Random random(4);
  for (int n = 0; n < 100; ++n) {
    // Rows orthogonal to a known unit vector, plus a little.
    Vec9 truth{};
    double norm = 0;
    for (double& x : truth) {
      x = uniform(random, -1, 1);
      norm += x * x;
    }
    for (double& x : truth) x /= std::sqrt(norm);
    std::array<double, 81> gram{};
    for (int row = 0; row < 30; ++row) {
      Vec9 v{};
      double along = 0;
      for (std::size_t i = 0; i < 9; ++i) {
        v[i] = uniform(random, -1, 1);
        along += v[i] * truth[i];
      }
      for (std::size_t i = 0; i < 9; ++i) v[i] -= along * truth[i];
      for (std::size_t i = 0; i < 9; ++i)
        for (std::size_t k = 0; k < 9; ++k) gram[i * 9 + k] += v[i] * v[k];
    }
    const Vec9 found = smallest_eigenvector<9>(gram);
    double product = 0;
    for (std::size_t i = 0; i < 9; ++i) product += found[i] * truth[i];
    EXPECT_NEAR(std::abs(product), 1, 1e-12);
  }
}

TEST(SmallestEigenvector, DiagonalAndZeroMatrices) {
  EXPECT_NEAR(std::abs(smallest_eigenvector<3>({3, 0, 0, 0, 1, 0, 0, 0, 2})[1]), 1, 1e-15);
  const Vec3 any = smallest_eigenvector<3>({});
  EXPECT_NEAR(dot(any, any), 1, 1e-15);
}

TEST(NullVector, OfRankTwo) {
  const Vec3 a{1, 2, 3}, b{-1, 0.5, 2};
  const Mat3 m{a[0], a[1], a[2], b[0], b[1], b[2], a[0] + b[0], a[1] + b[1], a[2] + b[2]};
  const auto v = null_vector(m);
  ASSERT_TRUE(v.has_value());
  for (const double x : multiply(m, *v)) EXPECT_NEAR(x, 0, 1e-14);
  EXPECT_FALSE(null_vector({1, 2, 3, 2, 4, 6, 3, 6, 9}).has_value());
  EXPECT_FALSE(null_vector({}).has_value());
}

TEST(Adjugate, TimesTheMatrixIsTheDeterminant) {
  const Mat3 m{2, -1, 0.5, 3, 4, -2, 1, 1, 5};
  const Mat3 product = multiply(adjugate(m), m);
  for (std::size_t i = 0; i < 9; ++i)
    EXPECT_NEAR(product[i], i % 4 == 0 ? determinant(m) : 0, 1e-12);
}

}  // namespace
}  // namespace loopd
