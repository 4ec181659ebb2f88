#include "decompositions.hpp"

#include <algorithm>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace heft::identify {

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

MatrixXd solve_symmetric(const MatrixXd& A, MatrixXd B) {
  Eigen::LDLT<MatrixXd>(A).solveInPlace(B);
  return B;
}

bool cholesky(const MatrixXd& A, MatrixXd& L) {
  const Eigen::LLT<MatrixXd> factor(A);
  L = factor.matrixL();
  return factor.info() == Eigen::Success;
}

bool solve_positive(const MatrixXd& A, MatrixXd& B) {
  const Eigen::LLT<MatrixXd> factor(A);
  if (factor.info() != Eigen::Success) return false;
  factor.solveInPlace(B);
  return true;
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

MatrixXd complement_of(const MatrixXd& A, double threshold) {
  Eigen::ColPivHouseholderQR<MatrixXd> factors(A);
  factors.setThreshold(threshold);
  MatrixXd Q = MatrixXd::Identity(A.rows(), A.rows());
  Q.applyOnTheLeft(factors.householderQ());
  return Q.rightCols(A.rows() - factors.rank());
}

}  // namespace heft::identify
