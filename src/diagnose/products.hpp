/// @file
/// Products of tall matrices, where a diagnosis spends much of its time.
#pragma once

#include <Eigen/Core>

namespace heft::diagnose {

/// Aᵀ B, p × k, summed over the rows in an order that depends on their number only: the last bit is the same on every
/// processor, whatever its vector unit.
/// @param A  m × p
/// @param B  m × k
Eigen::MatrixXd transposed_times(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                 const Eigen::Ref<const Eigen::MatrixXd>& B);
/// Adds Aᵀ B to a sum, p × k. Rows that are added in pieces of kProductPiece give what all of them together give, to the last
/// bit.
void add_transposed_times(const Eigen::Ref<const Eigen::MatrixXd>& A, const Eigen::Ref<const Eigen::MatrixXd>& B,
                          Eigen::Ref<Eigen::MatrixXd> sum);
/// Rows that are summed before the next columns are looked at: with 40 columns they stay in a second-level cache.
inline constexpr Eigen::Index kProductPiece = 256;
/// Aᵀ A, p × p, at half the cost.
Eigen::MatrixXd gram_of(const Eigen::Ref<const Eigen::MatrixXd>& A);

}  // namespace heft::diagnose
