#include "heft/host/decompositions.hpp"

#include <algorithm>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace heft {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

using SquareSvd = Eigen::JacobiSVD<MatrixXd, Eigen::NoQRPreconditioner>;

/// The first k rows of the upper triangle.
MatrixXd upper(const MatrixXd& A, Eigen::Index k) {
  MatrixXd R = MatrixXd::Zero(k, A.cols());
  for (Eigen::Index j = 0; j < A.cols(); ++j)
    R.col(j).head(std::min(j + 1, k)) = A.col(j).head(std::min(j + 1, k));
  return R;
}

template <typename Right>
bool solve_by_cholesky(const MatrixXd& A, Right& B) {
  const Eigen::LLT<MatrixXd> factor(A);
  if (factor.info() != Eigen::Success) return false;
  factor.solveInPlace(B);
  return true;
}

}  // namespace

Svd svd_of(const MatrixXd& A) {
  const SquareSvd svd(A, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {svd.matrixU(), svd.singularValues(), svd.matrixV()};
}

VectorXd singular_values(const MatrixXd& A) { return SquareSvd(A).singularValues(); }

Eigensystem eigensystem_of(const MatrixXd& A) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(A);
  return {solver.info() == Eigen::Success, solver.eigenvalues(), solver.eigenvectors()};
}

VectorXd eigenvalues_of(const MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(A, Eigen::EigenvaluesOnly).eigenvalues();
}

MatrixXd solve_square(const MatrixXd& A, const MatrixXd& B) {
  return Eigen::PartialPivLU<MatrixXd>(A).solve(B);
}

MatrixXd solve_symmetric(const MatrixXd& A, MatrixXd B) {
  Eigen::LDLT<MatrixXd>(A).solveInPlace(B);
  return B;
}

bool cholesky(const MatrixXd& A, MatrixXd& L) {
  const Eigen::LLT<MatrixXd> factor(A);
  L = factor.matrixL();
  return factor.info() == Eigen::Success;
}

bool solve_positive(const MatrixXd& A, MatrixXd& B) { return solve_by_cholesky(A, B); }
bool solve_positive(const MatrixXd& A, VectorXd& b) { return solve_by_cholesky(A, b); }

void solve_lower(const MatrixXd& L, MatrixXd& B) { L.triangularView<Eigen::Lower>().solveInPlace(B); }
void solve_lower(const MatrixXd& L, VectorXd& b) { L.triangularView<Eigen::Lower>().solveInPlace(b); }

void solve_lower_transposed(const MatrixXd& L, VectorXd& b) {
  L.transpose().triangularView<Eigen::Upper>().solveInPlace(b);
}

MatrixXd least_squares(const MatrixXd& A, const MatrixXd& B) {
  return Eigen::ColPivHouseholderQR<MatrixXd>(A).solve(B);
}

Qr qr_of(const MatrixXd& A) {
  const Eigen::HouseholderQR<MatrixXd> factors(A);
  const Eigen::Index k = std::min(A.rows(), A.cols());
  MatrixXd Q = MatrixXd::Identity(A.rows(), k);
  Q.applyOnTheLeft(factors.householderQ());
  return {Q, upper(factors.matrixQR(), k)};
}

MatrixXd triangle_of(const MatrixXd& A) {
  return upper(Eigen::HouseholderQR<MatrixXd>(A).matrixQR(), std::min(A.rows(), A.cols()));
}

MatrixXd pseudo_inverse(const MatrixXd& A) {
  // A = Q R, R = U S Vᵀ: A⁺ = V S⁺ Uᵀ Qᵀ.
  const Qr qr = qr_of(A);
  const Svd svd = svd_of(qr.R);
  const double least = svd.values[0] * std::numeric_limits<double>::epsilon() * static_cast<double>(A.cols());
  const VectorXd inverse = (svd.values.array() > least).select(svd.values.cwiseInverse(), 0.0);
  return svd.V * inverse.asDiagonal() * (qr.Q * svd.U).transpose();
}

MatrixXd complement_of(const MatrixXd& A, double threshold) {
  Eigen::ColPivHouseholderQR<MatrixXd> factors(A);
  factors.setThreshold(threshold);
  MatrixXd Q = MatrixXd::Identity(A.rows(), A.rows());
  Q.applyOnTheLeft(factors.householderQ());
  return Q.rightCols(A.rows() - factors.rank());
}

}  // namespace heft
