// The triangular factor against a QR of all rows at once.
#include <random>

#include <gtest/gtest.h>
#include <Eigen/QR>

#include "heft/regression/triangular_factor.hpp"

namespace heft::regression {
namespace {

Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index cols, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return normal(random); });
}

TEST(TriangularFactor, HoldsTheLeastSquaresProblemOfItsRows) {
  const Eigen::MatrixXd W = random_matrix(300, 12, 1);
  const Eigen::VectorXd y = random_matrix(300, 1, 2);
  TriangularFactor factor(12);
  factor.add(W.topRows(5), y.head(5));
  factor.add(W.middleRows(5, 200), y.segment(5, 200));
  factor.add(W.bottomRows(95), y.tail(95));
  EXPECT_EQ(factor.rows(), 300);
  const Eigen::VectorXd beta = W.colPivHouseholderQr().solve(y);
  const Eigen::VectorXd found = factor.R().triangularView<Eigen::Upper>().solve(factor.z());
  EXPECT_LT((found - beta).norm(), 1e-12 * beta.norm());
  EXPECT_NEAR(factor.squared_error(beta), (W * beta - y).squaredNorm(), 1e-10);
  EXPECT_LT((factor.information() - W.transpose() * W).norm(), 1e-11 * W.squaredNorm());
  const Eigen::VectorXd other = random_matrix(12, 1, 3);
  EXPECT_LT((factor.gradient(other) - W.transpose() * (y - W * other)).norm(), 1e-10);
}

TEST(TriangularFactor, KeepsWhatNormalEquationsLose) {
  // Columns that differ by 1e-9: their squares differ by 1e-18, below double precision.
  Eigen::MatrixXd W = random_matrix(200, 3, 4);
  W.col(2) = W.col(1) + 1e-9 * W.col(2);
  const Eigen::Vector3d truth(1.0, 2.0, 3.0);
  TriangularFactor factor(3);
  factor.add(W, W * truth);
  const Eigen::VectorXd found = factor.R().triangularView<Eigen::Upper>().solve(factor.z());
  EXPECT_LT((found - truth).norm(), 1e-5);
}

TEST(TriangularFactor, AddsFactorsWithWeights) {
  const Eigen::MatrixXd A = random_matrix(50, 4, 5), B = random_matrix(60, 4, 6);
  const Eigen::VectorXd a = random_matrix(50, 1, 7), b = random_matrix(60, 1, 8);
  TriangularFactor fa(4), fb(4);
  fa.add(A, a);
  fb.add(B, b);
  fa.add(fb, 4.0);
  EXPECT_LT((fa.information() - A.transpose() * A - 4.0 * B.transpose() * B).norm(), 1e-10);
}

TEST(BlockFactors, StayBoundedAndLoseNothing) {
  constexpr int kColumns = 5;
  const Eigen::Index rows = 4000;
  const Eigen::MatrixXd W = random_matrix(rows, kColumns, 9);
  const Eigen::VectorXd y = random_matrix(rows, 1, 10);
  const Eigen::VectorXd time = Eigen::VectorXd::LinSpaced(rows, -1.0, 399.0);
  BlockFactors blocks(2, kColumns, 1.0, 16);
  for (int log = 0; log < 2; ++log) {
    for (int joint = 0; joint < 2; ++joint) {
      for (Eigen::Index first = 0; first < rows; first += 500) {
        blocks.add(log, joint, time.segment(first, 500), W.middleRows(first, 500) * (1.0 + joint),
                   y.segment(first, 500));
      }
    }
  }
  EXPECT_LE(blocks.num_blocks(), 17);
  EXPECT_GE(blocks.num_blocks(), 8);
  const TriangularFactor all = blocks.weighted(Eigen::Vector2d(1.0, 0.25));
  EXPECT_LT((all.information() - 4.0 * (W.transpose() * W)).norm(), 1e-9 * W.squaredNorm());
  for (int b = 1; b < blocks.num_blocks(); ++b) {
    EXPECT_TRUE(blocks.log_of(b) > blocks.log_of(b - 1) || blocks.begin_of(b) > blocks.begin_of(b - 1));
  }
  std::vector<bool> leave_out(static_cast<std::size_t>(blocks.num_blocks()), true);
  leave_out[3] = false;
  EXPECT_EQ(blocks.weighted(Eigen::Vector2d::Ones(), leave_out).rows(),
            blocks.factor(3, 0).rows() + blocks.factor(3, 1).rows());
}

}  // namespace
}  // namespace heft::regression
