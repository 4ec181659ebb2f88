// The triangular factor against a QR of all rows at once.
#include <algorithm>
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
  const std::vector<TriangularFactor> joints = blocks.joints();
  ASSERT_EQ(joints.size(), 2U);
  for (int j = 0; j < 2; ++j) {
    const TriangularFactor& joint = joints[static_cast<std::size_t>(j)];
    EXPECT_EQ(joint.rows(), 2 * rows);
    EXPECT_LT((joint.information() - 2.0 * (1.0 + j) * (1.0 + j) * (W.transpose() * W)).norm(), 1e-9 * W.squaredNorm());
  }
  for (int b = 1; b < blocks.num_blocks(); ++b) {
    EXPECT_GT(blocks.key(b), blocks.key(b - 1));
  }
  std::vector<bool> leave_out(static_cast<std::size_t>(blocks.num_blocks()), true);
  leave_out[3] = false;
  EXPECT_EQ(blocks.weighted(Eigen::Vector2d::Ones(), leave_out).rows(),
            blocks.factor(3, 0).rows() + blocks.factor(3, 1).rows());
}

/// Rows of a log of its own length, beginning at its own time.
void add_log(BlockFactors& factors, long log) {
  const Eigen::Index rows = 40 + 7 * (log % 11);
  const double begin = log % 3 == 0 ? -1.7 : 1.7e9 + static_cast<double>(log);
  const Eigen::VectorXd time =
      Eigen::VectorXd::LinSpaced(rows, begin, begin + 0.05 * static_cast<double>(rows));
  const auto seed = static_cast<std::uint64_t>(log);
  for (int joint = 0; joint < 2; ++joint)
    factors.add(log, joint, time, random_matrix(rows, 4, 2 * seed), random_matrix(rows, 1, 2 * seed + 1));
}

TEST(BlockFactors, HoldTheSameBlocksInWhateverOrderAndGroupingTheyWereMerged) {
  for (const long logs : {3L, 40L, 150L}) {
    BlockFactors all(2, 4, 0.5, 32);
    for (long log = 0; log < logs; ++log) add_log(all, log);
    EXPECT_LE(all.num_blocks(), 32);
    std::mt19937_64 random(7);
    for (int round = 0; round < 5; ++round) {
      std::vector<BlockFactors> parts;
      for (long log = 0; log < logs; ++log) {
        // Some parts hold several logs from the start.
        if (parts.empty() || random() % 3 != 0) parts.emplace_back(2, 4, 0.5, 32);
        add_log(parts.back(), log);
      }
      while (parts.size() > 1) {
        std::shuffle(parts.begin(), parts.end(), random);
        const BlockFactors last = std::move(parts.back());
        parts.pop_back();
        parts.back().add(last);
      }
      const BlockFactors& merged = parts.front();
      ASSERT_EQ(merged.num_blocks(), all.num_blocks()) << logs;
      EXPECT_EQ(merged.partition().level(), all.partition().level());
      for (int b = 0; b < all.num_blocks(); ++b) {
        EXPECT_EQ(merged.key(b), all.key(b));
        EXPECT_EQ(merged.factor(b, 1).rows(), all.factor(b, 1).rows());
        EXPECT_LT((merged.factor(b, 1).information() - all.factor(b, 1).information()).norm(), 1e-10);
      }
    }
  }
}

}  // namespace
}  // namespace heft::regression
