#include "heft/statistics/interval.hpp"

#include <cmath>

#include <gtest/gtest.h>

namespace heft::statistics {
namespace {

TEST(Interval, ReachesAsManyStandardDeviationsAsItsFactorSays) {
  const Interval x = Interval::around(3.0, 0.5, 2.0);
  EXPECT_EQ(x.lower, 2.0);
  EXPECT_EQ(x.upper, 4.0);
  EXPECT_EQ(x.half_width(), 1.0);
  EXPECT_EQ(x.std, 0.5);
  EXPECT_DOUBLE_EQ(Interval::around(0.0, 1.0).half_width(), 1.96);
}

TEST(Interval, ContainsItsEndsAndNothingBeyond) {
  const Interval x = Interval::around(3.0, 0.5, 2.0);
  EXPECT_TRUE(x.contains(2.0));
  EXPECT_TRUE(x.contains(4.0));
  EXPECT_FALSE(x.contains(std::nextafter(2.0, 0.0)));
  EXPECT_FALSE(x.contains(std::nextafter(4.0, 5.0)));
  EXPECT_FALSE(Interval{}.contains(0.0)) << "what is not known contains nothing";
}

TEST(Interval, OfAReciprocalTurnsItsEndsOver) {
  const Interval k = reciprocal({0.5, 0.05, 0.4, 0.8});
  EXPECT_EQ(k.value, 2.0);
  EXPECT_EQ(k.std, 0.05 / 0.25);
  EXPECT_EQ(k.lower, 1.25);
  EXPECT_EQ(k.upper, 2.5);
}

TEST(Interval, OfTheReciprocalOfWhatMayBeZeroIsOpenAbove) {
  const Interval k = reciprocal({0.1, 0.1, -0.1, 0.25});
  EXPECT_EQ(k.value, 10.0);
  EXPECT_EQ(k.lower, 4.0);
  EXPECT_TRUE(std::isinf(k.upper));
  EXPECT_TRUE(std::isinf(reciprocal({-0.1, 0.1, -0.3, 0.1}).value));
  EXPECT_TRUE(std::isnan(reciprocal({-0.1, 0.1, -0.3, 0.1}).std));
  EXPECT_EQ(reciprocal({-2.0, 0.1, -2.2, -1.8}).lower, 0.0);
}

TEST(CountInterval, IsThatOfTheTables) {
  // Printed tables of Garwood's interval, 95 %; for zero counted exactly -ln 0.025.
  EXPECT_EQ(count_interval(0).lower, 0.0);
  EXPECT_NEAR(count_interval(0).upper, -std::log(0.025), 1e-9);
  EXPECT_NEAR(count_interval(1).lower, 0.0253, 1e-4);
  EXPECT_NEAR(count_interval(1).upper, 5.572, 1e-3);
  EXPECT_NEAR(count_interval(10).lower, 4.795, 1e-3);
  EXPECT_NEAR(count_interval(10).upper, 18.39, 1e-2);
  EXPECT_EQ(count_interval(10).value, 10.0);
}

}  // namespace
}  // namespace heft::statistics
