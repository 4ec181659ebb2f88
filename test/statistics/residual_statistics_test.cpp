/// Scatter and correlation of what a model leaves.
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "heft/statistics/residual_statistics.hpp"

namespace heft::statistics {
namespace {

/// First-order noise e(k+1) = a e(k) + w(k): ρ(k) = a^k, so the time is T (1 + a)/(1 - a).
Eigen::VectorXd first_order(double a, int count, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd e(count);
  double value = normal(generator) / std::sqrt(1 - a * a);
  for (double& x : e) {
    x = value;
    value = a * value + normal(generator);
  }
  return e;
}

TEST(CorrelationTime, MatchesFirstOrderNoise) {
  for (const double a : {0.0, 0.5, 0.9, 0.98}) {
    const double expected = 0.01 * (1 + a) / (1 - a);
    EXPECT_NEAR(correlation_time(first_order(a, 200000, 1), 0.01), expected, 0.15 * expected) << "a = " << a;
  }
}

TEST(CorrelationTime, ToleratesHolesAndTooLittle) {
  Eigen::VectorXd e = first_order(0.9, 100000, 2);
  const double whole = correlation_time(e, 0.01);
  for (Eigen::Index k = 0; k < e.size(); k += 1000)
    e.segment(k, 200).setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_NEAR(correlation_time(e, 0.01), whole, 0.2 * whole);
  e.setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(correlation_time(e, 0.01), 0.01);
  EXPECT_EQ(correlation_time(Eigen::VectorXd::Ones(5), 0.01), 0.01);
}

TEST(CorrelationTime, AConstantErrorIsCorrelatedForLong) {
  EXPECT_GT(correlation_time(Eigen::VectorXd::Ones(1000), 0.01), 1.0);
}

TEST(ResidualStatistics, BlocksAreSeveralCorrelationTimesLongButLeaveTen) {
  ResidualStatistics residual;
  residual.correlation_time = Eigen::Vector2d(0.2, 0.8);
  EXPECT_DOUBLE_EQ(residual.block_length(60), 2.4);
  EXPECT_DOUBLE_EQ(residual.block_length(15), 1.5);
  EXPECT_DOUBLE_EQ(residual.block_length(3), 1.0);
  EXPECT_DOUBLE_EQ(residual.correlated_samples(0.01), 80);
  EXPECT_DOUBLE_EQ(residual.correlated_samples(2), 1);
  EXPECT_DOUBLE_EQ(ResidualStatistics{}.block_length(60), 1.0);
  EXPECT_DOUBLE_EQ(residual.edge_factor(2.0), 1.25);
  EXPECT_DOUBLE_EQ(residual.edge_factor(0.1), 2.0);
  EXPECT_DOUBLE_EQ(ResidualStatistics{}.edge_factor(1.0), 1.0);
}

}  // namespace
}  // namespace heft::statistics
