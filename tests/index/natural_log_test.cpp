#include "index/natural_log.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/descriptor_samples.h"

namespace loopd {
namespace {

// 4e-16, absolutely below 1 and relatively above.
double tolerance(double log) { return 4e-16 * std::max(1.0, std::fabs(log)); }

TEST(NaturalLog, EqualsTheLibraryOnRatiosOfImageCounts) {
  for (int n = 1; n <= 400; ++n)
    for (int of = 1; of <= n; ++of) {
      const double x = static_cast<double>(n) / of;
      ASSERT_NEAR(natural_log(x), std::log(x), tolerance(std::log(x))) << n << " / " << of;
    }
}

TEST(NaturalLog, EqualsTheLibraryOverTheWholeRange) {
  DescriptorSamples samples(1);
  for (int i = 0; i < 20'000; ++i) {
    const double mantissa = 1 + static_cast<double>(samples.next() >> 11) * 0x1p-53;
    const double x = std::ldexp(mantissa, static_cast<int>(samples.below(2000)) - 1000);
    ASSERT_NEAR(natural_log(x), std::log(x), tolerance(std::log(x))) << x;
  }
  EXPECT_NEAR(natural_log(std::numeric_limits<double>::max()), 709.782712893384, 1e-12);
  EXPECT_NEAR(natural_log(std::numeric_limits<double>::min()), -708.3964185322641, 1e-12);
}

TEST(NaturalLog, IsExactlyZeroAtOneAndNeverNegativeAbove) {
  EXPECT_EQ(natural_log(1.0), 0.0);
  EXPECT_GT(natural_log(std::nextafter(1.0, 2.0)), 0.0);
  EXPECT_LT(natural_log(std::nextafter(1.0, 0.0)), 0.0);
}

TEST(NaturalLogDeathTest, RefusesWhatHasNoLogarithm) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_DEATH(natural_log(0.0), "");
  EXPECT_DEATH(natural_log(-1.0), "");
  EXPECT_DEATH(natural_log(std::numeric_limits<double>::infinity()), "");
}

}  // namespace
}  // namespace loopd
