/// @file
/// Decompositions of dense matrices of run-time size as ordinary functions: the templates behind them take longer to
/// compile than the code around them, so they are compiled once.
#pragma once

#include <Eigen/Core>

namespace heft {

/// A = U diag(values) Vᵀ.
struct Svd {
  Eigen::MatrixXd U;
  Eigen::VectorXd values;  ///< largest first
  Eigen::MatrixXd V;
};

/// Jacobi rotations. @pre A is square
Svd svd_of(const Eigen::MatrixXd& A);
Eigen::VectorXd singular_values(const Eigen::MatrixXd& A);

/// A = vectors diag(values) vectorsᵀ.
struct Eigensystem {
  bool converged{false};
  Eigen::VectorXd values;  ///< smallest first
  Eigen::MatrixXd vectors;
};

/// @pre A is symmetric; its lower triangle is read
Eigensystem eigensystem_of(const Eigen::MatrixXd& A);
Eigen::VectorXd eigenvalues_of(const Eigen::MatrixXd& A);

/// A⁻¹ B by A = P L U. @pre A is square and regular
Eigen::MatrixXd solve_square(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

/// A⁻¹ B by A = P L D Lᵀ Pᵀ. @pre A is symmetric and semidefinite; its lower triangle is read
Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& A, Eigen::MatrixXd B);

/// A = L Lᵀ. @return false when A is not positive definite; L is then undefined
bool cholesky(const Eigen::MatrixXd& A, Eigen::MatrixXd& L);

/// B becomes A⁻¹ B by A = L Lᵀ. @return false when A is not positive definite; B is then left alone
bool solve_positive(const Eigen::MatrixXd& A, Eigen::MatrixXd& B);
bool solve_positive(const Eigen::MatrixXd& A, Eigen::VectorXd& b);

/// B becomes L⁻¹ B. @pre L is lower triangular
void solve_lower(const Eigen::MatrixXd& L, Eigen::MatrixXd& B);
void solve_lower(const Eigen::MatrixXd& L, Eigen::VectorXd& b);
/// b becomes L⁻ᵀ b. @pre L is lower triangular
void solve_lower_transposed(const Eigen::MatrixXd& L, Eigen::VectorXd& b);

/// Solution of A X = B, or least squares, by pivoted QR. Where columns of A depend on others, some stay at 0.
Eigen::MatrixXd least_squares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

/// A = Q R, k = min(rows, columns).
struct Qr {
  Eigen::MatrixXd Q;  ///< rows × k
  Eigen::MatrixXd R;  ///< k × columns, upper triangular
};
Qr qr_of(const Eigen::MatrixXd& A);
/// R alone, k × columns.
Eigen::MatrixXd triangle_of(const Eigen::MatrixXd& A);

/// Moore-Penrose inverse. @pre A has at least as many rows as columns
Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd& A);

/// Orthonormal columns that span what is at right angles to the columns of A, by pivoted QR; its diagonal counts as
/// zero below `threshold` times the largest.
Eigen::MatrixXd complement_of(const Eigen::MatrixXd& A, double threshold);

}  // namespace heft
