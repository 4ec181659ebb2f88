#include <gtest/gtest.h>

#include "heft/statistics/correlation.hpp"
#include "heft/statistics/jackknife.hpp"

namespace heft::statistics {
namespace {

// The mean of B values, one a block, has the estimated variance s²/B: both estimates give it exactly.
const Eigen::RowVectorXd kValues{{1.0, -2.0, 4.0, 0.5, 3.0, 7.0}};

double variance_of_the_mean() {
  const auto B = static_cast<double>(kValues.size());
  return (kValues.array() - kValues.mean()).square().sum() / (B - 1.0) / B;
}

TEST(Jackknife, GivesTheVarianceOfAMean) {
  const auto B = static_cast<double>(kValues.size());
  const double mean = kValues.mean();
  const Eigen::RowVectorXd without = (kValues.sum() - kValues.array()) / (B - 1.0);
  const Eigen::MatrixXd changes = without.array() - mean;
  EXPECT_NEAR(jackknife_covariance(changes)(0, 0), variance_of_the_mean(), 1e-14);
  EXPECT_NEAR(jackknife_covariance(changes, 1.5)(0, 0), 1.5 * variance_of_the_mean(), 1e-14);
  const Eigen::MatrixXd shares = (kValues.array() - mean) / B;
  EXPECT_NEAR(sandwich_covariance(shares)(0, 0), variance_of_the_mean(), 1e-14);
}

TEST(Jackknife, IsZeroWithFewerThanTwoBlocks) {
  EXPECT_EQ(jackknife_covariance(Eigen::MatrixXd::Ones(3, 1)), Eigen::MatrixXd::Zero(3, 3));
  EXPECT_EQ(jackknife_covariance(Eigen::MatrixXd(3, 0)), Eigen::MatrixXd::Zero(3, 3));
  EXPECT_EQ(sandwich_covariance(Eigen::MatrixXd::Ones(3, 1)), Eigen::MatrixXd::Zero(3, 3));
}

TEST(CorrelatedSamples, EndAtTheFirstLagThatIsNotCorrelated) {
  // 1 + 2 (0.5 + 0.25); the third is not above 0.05, and what comes after it does not count.
  const double rho[] = {1.0, 0.5, 0.25, 0.05, 0.9};
  const auto at = [&](Eigen::Index lag) { return rho[lag]; };
  EXPECT_DOUBLE_EQ(correlated_samples(at, 5), 2.5);
  EXPECT_DOUBLE_EQ(correlated_samples(at, 2), 2.0);
  EXPECT_DOUBLE_EQ(correlated_samples(at, 1), 1.0);
}

}  // namespace
}  // namespace heft::statistics
