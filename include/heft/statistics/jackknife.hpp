/// @file
/// Covariance of an estimate from the estimates without one block of the data each.
#pragma once

#include <Eigen/Core>

namespace heft::statistics {

/// Covariance by the delete-a-block jackknife, V = f (B − 1)/B Σ_b d_b d_bᵀ, d_b = x₍b₎ − x, x₍b₎ being the
/// estimate without block b of B. It holds whatever the correlation inside a block; blocks must be several
/// correlation times long [1].
///
/// [1] J. G. MacKinnon, M. Ø. Nielsen, M. D. Webb, Cluster-robust inference: a guide to empirical practice,
///     Journal of Econometrics 232 (2023).
///
/// @param changes      p × B: d_b, one column a block
/// @param edge_factor  f, for the correlation across the edges of neighbouring blocks
///                     (ResidualStatistics::edge_factor)
/// @return p × p; zero with fewer than two blocks. Cost: p² B.
Eigen::MatrixXd jackknife_covariance(const Eigen::MatrixXd& changes, double edge_factor = 1.0);

/// Covariance from the first-order shares of the blocks in an estimate (the cluster-robust sandwich),
/// V = B/(B − 1) Σ_b s_b s_bᵀ [1].
/// @param shares  p × B: s_b = A⁻¹ X_bᵀ W r_b, one column a block
/// @return p × p; zero with fewer than two blocks
Eigen::MatrixXd sandwich_covariance(const Eigen::MatrixXd& shares);

}  // namespace heft::statistics
