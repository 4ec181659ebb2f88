/// Covariance by leaving out blocks.
#include <cmath>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "heft/statistics/block_jackknife.hpp"

namespace heft::statistics {
namespace {

struct Problem {
  Eigen::MatrixXd W;
  Eigen::VectorXd y;
};

Problem make_problem(int rows, int columns, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  Problem problem{Eigen::MatrixXd(rows, columns), Eigen::VectorXd(rows)};
  for (double& value : problem.W.reshaped()) value = normal(generator);
  for (double& value : problem.y) value = normal(generator);
  return problem;
}

TEST(BlockJackknife, EstimateIsTheRegularisedLeastSquares) {
  const Problem problem = make_problem(40, 3, 1);
  const Eigen::Vector3d prior(0.5, -1, 2), variance(4, 0.5, 100);
  BlockJackknife jackknife(prior, variance);
  for (int k = 0; k < 40; ++k) jackknife.add(k / 7, problem.W.row(k), problem.y[k], 0.25);
  const Eigen::Matrix3d A =
      Eigen::Matrix3d(variance.cwiseInverse().asDiagonal()) + 4 * problem.W.transpose() * problem.W;
  const Eigen::Vector3d x =
      A.inverse() * (prior.cwiseQuotient(variance) + 4 * problem.W.transpose() * problem.y);
  const auto result = jackknife.solve();
  EXPECT_LT((result.estimate - x).norm(), 1e-12);
  EXPECT_LT((result.information_inverse - A.inverse()).norm(), 1e-12);
  EXPECT_EQ(result.blocks, 6);
}

TEST(BlockJackknife, CovarianceOfAMeanIsItsTextbookJackknife) {
  // One column of ones, blocks of one row: the jackknife variance of a mean is s²/n exactly.
  const Problem problem = make_problem(25, 1, 2);
  BlockJackknife jackknife(Eigen::VectorXd::Zero(1), Eigen::VectorXd::Constant(1, 1e12));
  for (int k = 0; k < 25; ++k) jackknife.add(k, Eigen::VectorXd::Ones(1), problem.y[k], 1.0);
  const double variance = (problem.y.array() - problem.y.mean()).square().sum() / 24 / 25;
  EXPECT_NEAR(jackknife.solve().covariance(0, 0), variance, 1e-9 * variance);
}

TEST(BlockJackknife, MergesNeighboursAndSkipsBlocksNotAskedFor) {
  const Problem problem = make_problem(60, 2, 3);
  BlockJackknife fine(Eigen::VectorXd::Zero(2), Eigen::VectorXd::Constant(2, 100)), coarse = fine;
  for (int k = 0; k < 60; ++k) {
    fine.add(k / 5, problem.W.row(k), problem.y[k], 1.0);
    if (k < 40) coarse.add(k / 20, problem.W.row(k), problem.y[k], 1.0);
  }
  const auto merged = fine.solve({0, 1, 2, 3, 4, 5, 6, 7}, 4);
  const auto direct = coarse.solve();
  EXPECT_EQ(merged.blocks, 2);
  EXPECT_LT((merged.estimate - direct.estimate).norm(), 1e-12);
  EXPECT_LT((merged.covariance - direct.covariance).norm(), 1e-12);
}

TEST(BlockJackknife, DependenceIsTheSlopeOfTheEstimate) {
  const Problem problem = make_problem(30, 2, 4);
  const Problem other = make_problem(30, 3, 5);
  const Eigen::Vector3d z(0.3, -0.2, 0.5);
  BlockJackknife at_zero(Eigen::VectorXd::Zero(2), Eigen::VectorXd::Constant(2, 10)), at_z = at_zero;
  for (int k = 0; k < 30; ++k) {
    at_zero.add(0, problem.W.row(k), problem.y[k], 2.0);
    at_zero.add_dependence(0, problem.W.row(k), other.W.row(k), 2.0);
    at_z.add(0, problem.W.row(k), problem.y[k] - other.W.row(k).dot(z), 2.0);
  }
  const Eigen::VectorXd expected = at_zero.solve().estimate + at_zero.dependence({0}) * z;
  EXPECT_LT((at_z.solve().estimate - expected).norm(), 1e-12);
}

TEST(BlockJackknife, OneBlockGivesNoInterval) {
  BlockJackknife jackknife(Eigen::VectorXd::Zero(1), Eigen::VectorXd::Ones(1));
  jackknife.add(3, Eigen::VectorXd::Ones(1), 1.0, 1.0);
  EXPECT_TRUE(std::isinf(jackknife.solve().interval_factor));
  EXPECT_TRUE(jackknife.is_empty(2));
  EXPECT_FALSE(jackknife.is_empty(3));
  EXPECT_EQ(jackknife.solve({7}).blocks, 0);
}

}  // namespace
}  // namespace heft::statistics
