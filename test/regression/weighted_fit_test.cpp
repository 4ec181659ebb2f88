// The estimate without singular values is that of solve(), whether the rows want a ridge or not.
#include "heft/regression/weighted_fit.hpp"

#include <random>

#include <gtest/gtest.h>

namespace heft::regression {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kColumns = 6;
constexpr double kLimit = 1000.0;

MatrixXd random_rows(int rows) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(rows, kColumns, [&] { return normal(random); });
}

VectorXd norms_of(const MatrixXd& W) { return W.colwise().norm().transpose().cwiseMax(1.0); }

/// Rows of the parameters 10, 20, ... of columns of norm 1; noise 0.1.
TriangularFactor factor_of(const MatrixXd& W) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0.0, 0.1);
  TriangularFactor factor(kColumns);
  const VectorXd noise = VectorXd::NullaryExpr(W.rows(), [&] { return normal(random); });
  factor.add(W, W * VectorXd::LinSpaced(kColumns, 10.0, 60.0).cwiseQuotient(norms_of(W)) + noise);
  return factor;
}

struct Case {
  Solution solution;
  VectorXd estimate;
};

Case both(const MatrixXd& W) {
  const TriangularFactor data = factor_of(W);
  const VectorXd prior = VectorXd::Constant(kColumns, -3.0).cwiseQuotient(norms_of(W));
  return {solve(data, prior, kLimit), estimate(data, prior, kLimit)};
}

TEST(Estimate, OfWellConditionedRowsIsThatOfTheSingularValues) {
  MatrixXd W = random_rows(200);
  W.col(1) *= 1e6;  // units do not count
  const auto [solution, estimate] = both(W);
  ASSERT_LT(solution.condition, kLimit / 10.0);
  EXPECT_EQ(solution.ridge, 0.0);
  for (int p = 0; p < kColumns; ++p) EXPECT_NEAR(estimate[p] / solution.beta[p], 1.0, 1e-12) << p;
}

TEST(Estimate, OfNearlyDependentColumnsHasTheRidge) {
  MatrixXd W = random_rows(200);
  W.col(3) = W.col(2) + 1e-5 * W.col(3);
  const auto [solution, estimate] = both(W);
  ASSERT_GT(solution.ridge, 0.0);
  EXPECT_EQ(estimate, solution.beta);
}

TEST(Estimate, OfAParameterThatNoRowTellsIsThePrior) {
  MatrixXd W = random_rows(200);
  W.col(3).setZero();
  const auto [solution, estimate] = both(W);
  EXPECT_EQ(estimate, solution.beta);
  EXPECT_EQ(estimate[3], -3.0);
}

}  // namespace
}  // namespace heft::regression
