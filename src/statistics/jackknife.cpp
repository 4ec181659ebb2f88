#include "heft/statistics/jackknife.hpp"

namespace heft::statistics {
namespace {

/// Σ_b a_b a_bᵀ over the columns of A, in their order.
Eigen::MatrixXd sum_of_squares(const Eigen::MatrixXd& A) {
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(A.rows(), A.rows());
  for (const auto& column : A.colwise()) sum.noalias() += column * column.transpose();
  return sum;
}

}  // namespace

Eigen::MatrixXd jackknife_covariance(const Eigen::MatrixXd& changes, double edge_factor) {
  const auto B = static_cast<double>(changes.cols());
  if (B < 2.0) return Eigen::MatrixXd::Zero(changes.rows(), changes.rows());
  return edge_factor * (B - 1.0) / B * sum_of_squares(changes);
}

Eigen::MatrixXd sandwich_covariance(const Eigen::MatrixXd& shares) {
  const auto B = static_cast<double>(shares.cols());
  if (B < 2.0) return Eigen::MatrixXd::Zero(shares.rows(), shares.rows());
  return B / (B - 1.0) * sum_of_squares(shares);
}

}  // namespace heft::statistics
