// Total least squares against closed forms, and against plain least squares where the regressor is noisy.
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "heft/host/error.hpp"
#include "identify/total_least_squares.hpp"

namespace heft::identify {
namespace {

Eigen::MatrixXd random_matrix(Eigen::Index rows, Eigen::Index cols, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return normal(random); });
}

regression::TriangularFactor factor_of(const Eigen::MatrixXd& W, const Eigen::VectorXd& y) {
  regression::TriangularFactor factor(static_cast<int>(W.cols()));
  factor.add(W, y);
  return factor;
}

Eigen::VectorXd plain(const regression::TriangularFactor& data) {
  return data.R().triangularView<Eigen::Upper>().solve(data.z());
}

TEST(TotalLeastSquares, FitsALineAsDemingDoes) {
  // One noisy slope and an exact constant: W. E. Deming's closed form from the second moments,
  // slope = (s_yy − δ s_xx + √((s_yy − δ s_xx)² + 4 δ s_xy²)) / (2 s_xy), δ the ratio of the error variances
  // y : x.
  std::mt19937_64 random(1);
  const Eigen::VectorXd x0 = random_matrix(200, 1, random);
  Eigen::MatrixXd W(200, 2);
  W.col(0).setOnes();
  W.col(1) = x0 + 0.3 * random_matrix(200, 1, random);
  const Eigen::VectorXd y = (1.5 + (2.0 * x0).array()).matrix() + 0.6 * random_matrix(200, 1, random);
  TotalLeastSquaresOptions options;
  options.exact = {true, false};
  options.column_noise = Eigen::Vector2d(0.0, 0.3);
  options.torque_noise = 0.6;
  const TotalLeastSquaresFit fit = total_least_squares(factor_of(W, y), options);

  const double xm = W.col(1).mean(), ym = y.mean();
  const double sxx = (W.col(1).array() - xm).square().mean(), syy = (y.array() - ym).square().mean();
  const double sxy = ((W.col(1).array() - xm) * (y.array() - ym)).mean();
  const double delta = 4.0, d = syy - delta * sxx;
  const double slope = (d + std::sqrt(d * d + 4.0 * delta * sxy * sxy)) / (2.0 * sxy);
  EXPECT_NEAR(fit.beta[1], slope, 1e-12);
  EXPECT_NEAR(fit.beta[0], ym - slope * xm, 1e-12);
  EXPECT_TRUE(fit.separated);
  EXPECT_NEAR(fit.noise, 1.0, 0.15);
}

TEST(TotalLeastSquares, TakesAwayTheBiasOfEqualNoise) {
  std::mt19937_64 random(2);
  const Eigen::Vector3d truth(1.0, -2.0, 0.5);
  const Eigen::Vector3d size(1.0, 10.0, 0.1);
  const Eigen::MatrixXd W0 = random_matrix(20000, 3, random) * size.asDiagonal();
  const Eigen::VectorXd y0 = W0 * truth.cwiseQuotient(size);
  // Equal relative noise of 30 % everywhere, which the default assumes.
  const Eigen::MatrixXd W = W0 + 0.3 * random_matrix(20000, 3, random) * size.asDiagonal();
  const Eigen::VectorXd y = y0 + 0.3 * std::sqrt(truth.squaredNorm()) * random_matrix(20000, 1, random);
  const regression::TriangularFactor data = factor_of(W, y);
  const Eigen::VectorXd expected = truth.cwiseQuotient(size);
  const TotalLeastSquaresFit fit = total_least_squares(data);
  for (int i = 0; i < 3; ++i) {
    // Attenuation of least squares: 1/(1 + 0.3²) = 0.917.
    EXPECT_NEAR(plain(data)[i] / expected[i], 0.917, 0.02) << i;
    EXPECT_NEAR(fit.beta[i] / expected[i], 1.0, 0.02) << i;
  }
  EXPECT_NEAR(fit.noise, 0.3 / std::sqrt(1.09), 0.005);
  EXPECT_TRUE(fit.separated);
  EXPECT_GT(fit.separation, 2.0);
}

TEST(TotalLeastSquares, WithOnlyExactColumnsIsLeastSquares) {
  std::mt19937_64 random(3);
  const regression::TriangularFactor data =
      factor_of(random_matrix(50, 4, random), random_matrix(50, 1, random));
  TotalLeastSquaresOptions options;
  options.exact.assign(4, true);
  const TotalLeastSquaresFit fit = total_least_squares(data, options);
  EXPECT_LT((fit.beta - plain(data)).norm(), 1e-12);
  EXPECT_EQ(fit.singular_values.size(), 1);
}

TEST(TotalLeastSquares, ReproducesRowsWithoutNoise) {
  std::mt19937_64 random(4);
  const Eigen::MatrixXd W = random_matrix(60, 5, random);
  const Eigen::VectorXd truth = random_matrix(5, 1, random);
  TotalLeastSquaresOptions options;
  options.exact = {false, true, false, false, true};
  const TotalLeastSquaresFit fit = total_least_squares(factor_of(W, W * truth), options);
  EXPECT_LT((fit.beta - truth).norm(), 1e-11);
  EXPECT_TRUE(fit.separated);
  EXPECT_EQ(fit.separation, std::numeric_limits<double>::infinity());
}

TEST(TotalLeastSquares, FlagsADirectionThatIsOnlyNoise) {
  std::mt19937_64 random(5);
  Eigen::MatrixXd W0 = random_matrix(2000, 3, random);
  W0.col(2) = W0.col(1);
  const Eigen::Vector3d truth(1.0, 1.0, 1.0);
  const Eigen::MatrixXd W = W0 + 0.1 * random_matrix(2000, 3, random);
  const Eigen::VectorXd y = W0 * truth + 0.1 * random_matrix(2000, 1, random);
  TotalLeastSquaresOptions options;
  options.column_noise = Eigen::Vector3d::Constant(0.1);
  options.torque_noise = 0.1;
  const TotalLeastSquaresFit fit = total_least_squares(factor_of(W, y), options);
  EXPECT_FALSE(fit.separated);
  EXPECT_EQ(fit.left_out, 1);
  EXPECT_LT(fit.separation, 1.1);
  // What is determined is right all the same: the first column, and the sum of the other two.
  EXPECT_NEAR(fit.beta[0], 1.0, 0.02);
  EXPECT_NEAR(fit.beta[1] + fit.beta[2], 2.0, 0.02);
}

TEST(TotalLeastSquares, CovarianceIsTheScatterOverExperiments) {
  constexpr int kSeeds = 300, kRows = 400;
  const Eigen::Vector2d truth(1.0, -2.0);
  Eigen::Vector2d squared = Eigen::Vector2d::Zero(), stated = squared;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    std::mt19937_64 random(seed);
    const Eigen::MatrixXd W0 = random_matrix(kRows, 2, random);
    const Eigen::MatrixXd W = W0 + 0.3 * random_matrix(kRows, 2, random);
    const Eigen::VectorXd y = W0 * truth + 0.3 * truth.norm() * random_matrix(kRows, 1, random);
    regression::BlockFactors factors(1, 2, 0.5);
    factors.add(0, 0, Eigen::VectorXd::LinSpaced(kRows, 0.0, 19.9), W, y);
    const TotalLeastSquaresSpread spread =
        total_least_squares(factors, Eigen::VectorXd::Ones(1), {}, seed % 2 == 0 ? 1.0 : 0.0);
    EXPECT_EQ(spread.groups, seed % 2 == 0 ? 20 : 40);
    EXPECT_LT((spread.fit.beta - total_least_squares(factor_of(W, y)).beta).norm(), 1e-10);
    squared += (spread.fit.beta - truth).cwiseAbs2();
    stated += spread.covariance.diagonal();
  }
  // The scatter of 300 is known to ± 4 %.
  for (int i = 0; i < 2; ++i) EXPECT_NEAR(std::sqrt(stated[i] / squared[i]), 1.03, 0.12) << i;
}

TEST(TotalLeastSquares, RefusesANoiseThatIsNotPositive) {
  std::mt19937_64 random(6);
  const regression::TriangularFactor data =
      factor_of(random_matrix(50, 2, random), random_matrix(50, 1, random));
  TotalLeastSquaresOptions options;
  options.column_noise = Eigen::Vector2d(1.0, 0.0);
  EXPECT_THROW(total_least_squares(data, options), DataError);
  options.column_noise = Eigen::Vector3d::Ones();
  EXPECT_THROW(total_least_squares(data, options), DataError);
}

}  // namespace
}  // namespace heft::identify
