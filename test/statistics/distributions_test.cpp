// Tails and quantiles against printed tables and closed forms.
#include "heft/statistics/distributions.hpp"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace heft::statistics {
namespace {

TEST(IntervalFactor, IsStudentsT) {
  // Tables of Student's t, 0.975.
  EXPECT_NEAR(interval_factor(1), 12.706, 1e-3);
  EXPECT_NEAR(interval_factor(2), 4.303, 1e-3);
  EXPECT_NEAR(interval_factor(3), 3.182, 1e-2);
  EXPECT_NEAR(interval_factor(5), 2.5706, 5e-4);
  EXPECT_NEAR(interval_factor(10), 2.2281, 1e-4);
  EXPECT_NEAR(interval_factor(30), 2.0423, 1e-4);
  EXPECT_NEAR(interval_factor(100000), 1.95998, 1e-4);
}

TEST(FisherTail, AgreesWithClosedForms) {
  // F(2, d): (1 + 2 f/d)^(−d/2); F(1, 1): 1 − 2/π atan √f.
  EXPECT_NEAR(fisher_tail(3.0, 2.0, 10.0), std::pow(1.0 + 6.0 / 10.0, -5.0), 1e-12);
  EXPECT_NEAR(fisher_tail(40.0, 2.0, 60.0), std::pow(1.0 + 80.0 / 60.0, -30.0), 1e-20);
  EXPECT_NEAR(fisher_tail(5.0, 1.0, 1.0), 1.0 - 2.0 / std::numbers::pi * std::atan(std::sqrt(5.0)), 1e-12);
  EXPECT_EQ(fisher_tail(0.0, 3.0, 7.0), 1.0);
}

TEST(FisherTail, IsThatOfTheTables) {
  // Critical values of printed tables: F(0.05; 1, 10) = 4.9646, F(0.01; 5, 20) = 4.1027.
  EXPECT_NEAR(fisher_tail(4.9646, 1, 10), 0.05, 1e-5);
  EXPECT_NEAR(fisher_tail(4.1027, 5, 20), 0.01, 1e-5);
  EXPECT_EQ(fisher_tail(-1.0, 3, 10), 1.0);
}

TEST(Student, IsThatOfTheTables) {
  // Two-sided critical values: t(0.05; 10) = 2.2281, t(0.01; 5) = 4.0321, t(0.001; 20) = 3.8495.
  EXPECT_NEAR(student_two_sided(2.2281, 10.0), 0.05, 1e-5);
  EXPECT_NEAR(student_quantile(0.05, 10.0), 2.2281, 1e-4);
  EXPECT_NEAR(student_quantile(0.01, 5.0), 4.0321, 1e-4);
  EXPECT_NEAR(student_quantile(0.001, 20.0), 3.8495, 1e-4);
}

TEST(Student, DegreesOfFreedomAreFoundAgainFromTheIntervalFactor) {
  for (const int freedom : {1, 2, 7, 30, 200})
    EXPECT_EQ(degrees_of_freedom(interval_factor(freedom)), freedom);
  EXPECT_EQ(degrees_of_freedom(kNormal95), 1000);
}

}  // namespace
}  // namespace heft::statistics
