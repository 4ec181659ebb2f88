/// @file
/// Eigenvalues and eigenvectors of a symmetric 3 × 3 matrix in a bounded number of steps.
#pragma once

#include <cmath>

#include <Eigen/Core>

#include "heft/core/numeric_range.hpp"
#include "heft/core/status.hpp"

namespace heft {

template <typename Scalar>
using Matrix3 = Eigen::Matrix<Scalar, 3, 3>;

/// Eigenvalues, in no order, and the unit eigenvectors as columns.
template <typename Scalar>
struct SymmetricEigen {
  Eigen::Matrix<Scalar, 3, 1> values = Eigen::Matrix<Scalar, 3, 1>::Zero();
  Matrix3<Scalar> vectors = Matrix3<Scalar>::Identity();
};

/// A = V diag(λ) Vᵀ by cyclic Jacobi rotations (C. G. J. Jacobi, 1846; G. H. Golub, C. F. Van Loan, Matrix Computations,
/// section 8.5). Convergence is quadratic: five sweeps leave off-diagonal entries at rounding for any 3 × 3 matrix, the
/// sixth is spare.
///
/// @param A    only its lower triangle is read
/// @param out  unchanged unless kOk
/// @return kNonFiniteInput: an entry is NaN, infinite, or so large that its square is
/// Cost: at most 18 rotations of about 25 multiplications, 3 divisions and 2 roots; those of what rounds to zero are skipped.
template <typename Scalar>
Status symmetric_eigen(const Matrix3<Scalar>& A, SymmetricEigen<Scalar>& out) noexcept {
  using std::abs;
  using std::sqrt;
  constexpr int kSweeps = 6;
  Scalar largest(0);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j <= i; ++j) {
      if (!is_finite(A(i, j) * A(i, j))) {
        return Status::kNonFiniteInput;
      }
      largest = abs(A(i, j)) > largest ? abs(A(i, j)) : largest;
    }
  }
  SymmetricEigen<Scalar> found;
  if (!(largest > Scalar(0))) {
    out = found;
    return Status::kOk;
  }
  // To numbers of size 1, so that no product falls below the smallest number there is.
  Matrix3<Scalar> a;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j <= i; ++j) {
      a(i, j) = a(j, i) = A(i, j) / largest;
    }
  }
  Matrix3<Scalar>& v = found.vectors;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (int p = 0; p < 2; ++p) {
      for (int q = p + 1; q < 3; ++q) {
        // A turn by less than rounding changes nothing.
        if (!(abs(a(p, q)) > static_cast<Scalar>(0.05) * Eigen::NumTraits<Scalar>::epsilon())) {
          continue;
        }
        // tan of the angle that turns a(p, q) to zero, the smaller root of t² + 2 θ t − 1 = 0.
        const Scalar theta = (a(q, q) - a(p, p)) / (Scalar(2) * a(p, q));
        const Scalar size = abs(theta);
        // Beyond this θ² overflows or swallows the 1; t = 1 / (2 θ) to rounding.
        const Scalar root = size < static_cast<Scalar>(1e6) ? sqrt(theta * theta + Scalar(1)) : size;
        const Scalar t = (theta < Scalar(0) ? Scalar(-1) : Scalar(1)) / (size + root);
        const Scalar c = Scalar(1) / sqrt(t * t + Scalar(1));
        const Scalar s = t * c;
        const int r = 3 - p - q;  // the third
        const Scalar x = a(r, p);
        const Scalar y = a(r, q);
        a(r, p) = a(p, r) = c * x - s * y;
        a(r, q) = a(q, r) = s * x + c * y;
        a(p, p) -= t * a(p, q);
        a(q, q) += t * a(p, q);
        for (int k = 0; k < 3; ++k) {
          const Scalar vx = v(k, p);
          const Scalar vy = v(k, q);
          v(k, p) = c * vx - s * vy;
          v(k, q) = s * vx + c * vy;
        }
        a(p, q) = a(q, p) = Scalar(0);
      }
    }
  }
  for (int i = 0; i < 3; ++i) {
    found.values[i] = largest * a(i, i);
  }
  out = found;
  return Status::kOk;
}

}  // namespace heft
